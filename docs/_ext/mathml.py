"""Mathematics as MathML, made when the pages are built: a browser draws it without a script, a font or a network."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

logger = logging.getLogger(__name__)


def mathml(latex: str, display: str, node: nodes.Node) -> str:
    """Return LaTeX as MathML; warn of an unknown command, which would be drawn as its name."""
    known = re.sub(r"\\(begin|end)\{(?:aligned|align|gathered)\}", r"\\\1{align*}", latex)
    try:
        made = convert(known, display=display)
    except Exception as error:  # whatever latex2mathml makes of what it cannot read
        logger.warning("mathematics that cannot be read: %s (%r)", latex, error, location=node)
        return ""
    if unknown := re.findall(r"<m[ion]>(\\[A-Za-z]+|&)</m", made):
        logger.warning("mathematics with %s, which is not known: %s", ", ".join(unknown), latex, location=node)
    return made


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(mathml(node.astext(), "inline", node))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    number = get_node_equation_number(writer, node) if node.get("number") else ""
    writer.body.append(writer.starttag(node, "div", CLASS="equation"))
    writer.body.append(f'<span class="number">({number})</span>' if number else "")
    writer.body.append(f"{mathml(node.astext(), 'block', node)}</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
