"""How much the texts of a page in Chromium stand out from what is behind them (WCAG 2.2, 1.4.3)."""

from typing import Any

_FAINT = """() => {
    const context = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
    const colour = (words) => {
        context.clearRect(0, 0, 1, 1); context.fillStyle = words; context.fillRect(0, 0, 1, 1);
        const [red, green, blue, alpha] = context.getImageData(0, 0, 1, 1).data;
        return [red, green, blue, alpha / 255];
    };
    const over = ([r, g, b, alpha], [R, G, B]) => [[r, R], [g, G], [b, B]].map(([x, y]) => x * alpha + y * (1 - alpha));
    const linear = (v) => v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4;
    const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), faint = [];
    let text, count = 0;
    while ((text = texts.nextNode())) {
        const own = text.parentElement, range = document.createRange();
        range.selectNodeContents(text);
        const { width, height } = range.getBoundingClientRect();
        const shown = width && height && own.checkVisibility({ opacityProperty: true, visibilityProperty: true });
        if (!shown || !/[a-z0-9]/i.test(text.textContent)) continue; // marks of curves are no text
        let behind = [255, 255, 255], opacity = 1;
        const around = [];
        for (let one = own; one; one = one.parentElement) around.unshift(getComputedStyle(one));
        for (const style of around) { behind = over(colour(style.backgroundColor), behind); opacity *= style.opacity; }
        const style = around.at(-1), ink = colour(own instanceof SVGElement ? style.fill : style.color);
        const [low, high] = [luminance(over([...ink.slice(0, 3), ink[3] * opacity], behind)), luminance(behind)].sort((a, b) => a - b);
        const px = parseFloat(style.fontSize), large = px >= 24 || (px >= 18.66 && style.fontWeight >= 700);
        count += 1;
        if ((high + 0.05) / (low + 0.05) < (large ? 3 : 4.5)) faint.push(`${text.textContent.trim()}: ${((high + 0.05) / (low + 0.05)).toFixed(2)}`);
    }
    return [count, faint];
}"""  # noqa: E501


def faint_texts(page: Any, least: int) -> list[str]:
    """Texts with a contrast below 4.5, of large ones below 3, with it; the page must have so many texts at least."""
    count, faint = page.evaluate(_FAINT)
    assert count >= least
    return faint
