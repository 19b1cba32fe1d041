"""Formulas between dollars become MathML when the documentation is built: no script draws them."""

import html
import re

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


def _typeset(display):
    def typeset(found):
        return convert(html.unescape(found.group(1)).strip(), display=display)

    return typeset


def on_page_content(content, **_):
    content = _BLOCK.sub(_typeset("block"), content)
    content = _INLINE.sub(_typeset("inline"), content)
    if "arithmatex" in content:
        raise RuntimeError("a formula was left as it is written")
    return content
