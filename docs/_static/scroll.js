// What scrolls sideways can be scrolled with the keyboard: it takes the focus while it is wider than its place.
const SCROLLING = "pre, .table-wrapper, .equation";

function takeFocus() {
  for (const part of document.querySelectorAll(SCROLLING)) {
    const scrolls = part.scrollWidth > part.clientWidth || part.scrollHeight > part.clientHeight;
    if (scrolls) part.tabIndex = 0;
    else part.removeAttribute("tabindex");
  }
}

addEventListener("load", takeFocus);
addEventListener("resize", takeFocus);
