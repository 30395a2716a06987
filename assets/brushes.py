"""What the pictures are drawn with: noise on a torus, wood, letters, grids of cells."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Canvas = NDArray[np.float32]
"""`(H, W, 3)` RGB or `(H, W)` grey, 0..255."""

Colour = tuple[float, float, float]


def cloud(rng: np.random.Generator, height: int, width: int, slope: float = 1.6, coarsest: float = 2.0) -> Canvas:
    """`(height, width)` noise on a torus in [0, 1]: amplitude falls as frequency ** -slope."""
    fy = np.fft.fftfreq(height)[:, None] * height
    fx = np.fft.rfftfreq(width)[None, :] * width
    frequency = np.hypot(fy, fx)
    gain = np.where(frequency < 0.5, 0.0, np.maximum(frequency, coarsest) ** -slope)
    spectrum = np.fft.rfft2(rng.standard_normal((height, width))) * gain
    noise = np.fft.irfft2(spectrum, s=(height, width))
    low, high = np.percentile(noise, [1.0, 99.0])
    return np.clip((noise - low) / (high - low), 0.0, 1.0).astype(np.float32)


def flat(height: int, width: int, colour: Colour) -> Canvas:
    """One colour."""
    return np.full((height, width, 3), colour, np.float32)


def speckled(
    rng: np.random.Generator, height: int, width: int, colour: Colour, contrast: float, slope: float
) -> Canvas:
    """A colour with noise on its brightness; `contrast` is the peak-to-peak share."""
    light = 1.0 + contrast * (cloud(rng, height, width, slope) - 0.5)
    return flat(height, width, colour) * light[..., None]


def wood(rng: np.random.Generator, height: int, width: int, colour: Colour, boards: int = 1) -> Canvas:
    """Grain along x, in `boards` boards."""
    grain = cv2.resize(cloud(rng, height, 8, 0.7), (width, height), interpolation=cv2.INTER_CUBIC)
    image = flat(height, width, colour) * (0.75 + 0.5 * grain)[..., None]
    for board in range(boards):
        top, bottom = board * height // boards, (board + 1) * height // boards
        image[top:bottom] *= rng.uniform(0.88, 1.1)
        if boards > 1:
            image[top : top + max(1, height // 60)] *= 0.45
    return image


def text(image: Canvas, words: str, at: tuple[int, int], scale: float, colour: Colour, thick: int = 2) -> None:
    """Letters, drawn into the image."""
    ink = np.zeros(image.shape[:2], np.uint8)
    cv2.putText(ink, words, at, cv2.FONT_HERSHEY_DUPLEX, scale, (255,), thick, cv2.LINE_AA)
    share = (ink / 255.0).astype(np.float32)[..., None]
    image[:] = image * (1.0 - share) + share * np.array(colour, np.float32)


def rectangle(image: Canvas, x: float, y: float, w: float, h: float, colour: Colour, thick: int = -1) -> None:
    """A rectangle in shares of the image's size, drawn into it."""
    height, width = image.shape[:2]
    first = (round(x * width), round(y * height))
    last = (round((x + w) * width) - 1, round((y + h) * height) - 1)
    cv2.rectangle(image, first, last, colour, thick)


def shaded(image: Canvas, top: float, bottom: float) -> Canvas:
    """Brightness that runs from `top` to `bottom`."""
    return image * np.linspace(top, bottom, image.shape[0], dtype=np.float32)[:, None, None]


def hue_of(hue: float, saturation: float, value: float) -> Colour:
    """The colour of OpenCV's hue (0..180), saturation and value (0..255)."""
    pixel = np.array([[[hue % 180, saturation, value]]], np.uint8)
    red, green, blue = cv2.cvtColor(pixel, cv2.COLOR_HSV2RGB)[0, 0].tolist()
    return (float(red), float(green), float(blue))


def grid(cells: list[Canvas], columns: int) -> Canvas:
    """Cells side by side, row by row."""
    rows = [np.hstack(cells[at : at + columns]) for at in range(0, len(cells), columns)]
    return np.vstack(rows)
