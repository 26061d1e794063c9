// Names over the scene: a dot and a word at the places of marks, to the right of the dot or, at the edge of the picture,
// to its left. A word that would lie over another one is left out.
const GAP = 9, TALL = 15; // [pixels] from a dot to its word, and the height of a word
class Labels {
  constructor(box, marks) {
    this.marks = marks.map((mark) => {
      const element = document.createElement("div"), dot = document.createElement("i"), word = document.createElement("span");
      dot.style.background = mark.colour; word.textContent = mark.text; dot.hidden = !mark.dot; element.append(dot, word); box.append(element);
      return { ...mark, element };
    });
  }
  draw(now) {
    const { matrix } = now.view, { clientWidth: width, clientHeight: height } = now.canvas, taken = [];
    for (const mark of this.marks) {
      const { element, place, motion, layer } = mark;
      const pose = motion === null ? place : now.poses[motion]?.pos;
      let seen = pose && now.shows(layer);
      if (seen) {
        const p = now.raised(pose), clip = [0, 1, 3].map((i) => matrix[i] * p[0] + matrix[4 + i] * p[1] + matrix[8 + i] * p[2] + matrix[12 + i]);
        const x = width * (0.5 + 0.5 * clip[0] / clip[2]), y = height * (0.5 - 0.5 * clip[1] / clip[2]);
        seen = clip[2] > 0 && x > -20 && x < width + 20 && y > -20 && y < height + 20;
        if (seen) {
          element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
          const word = element.lastChild; element.hidden = word.hidden = false;
          const wide = mark.wide ??= word.offsetWidth, left = x + GAP + wide > width && x - GAP - wide > 0, from = left ? x - GAP - wide : x + GAP;
          word.style.left = `${left ? -GAP - wide : GAP}px`;
          word.hidden = taken.some(([begin, end, v]) => from < end && begin < from + wide && Math.abs(v - y) < TALL);
          if (!word.hidden) taken.push([from, from + wide, y]);
        }
      }
      element.hidden = !seen;
    }
  }
}
