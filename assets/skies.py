"""Skies: six faces of a cube, one above the other."""

from __future__ import annotations

import cv2
import numpy as np
from brushes import Canvas, cloud
from numpy.typing import NDArray


def directions(size: int) -> NDArray[np.float32]:
    """`(6, size, size, 3)` world directions of the pixels of a skybox: faces right, left, up, down, front, back.

    Face layout of OpenGL's cube maps; MuJoCo turns the sky by 90 degrees about x, so that cube y is world z and cube
    z is world -y.
    """
    line = (2.0 * (np.arange(size) + 0.5) / size - 1.0).astype(np.float32)
    s, t = np.meshgrid(line, line)
    one = np.ones_like(s)
    cube = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    faces = np.stack([np.stack([x, -z, y], axis=-1) for x, y, z in cube])
    return faces / np.linalg.norm(faces, axis=-1, keepdims=True)


def _sampled(noise: Canvas, x: Canvas, y: Canvas) -> Canvas:
    height, width = noise.shape
    return cv2.remap(
        noise,
        np.mod(x, 1.0).astype(np.float32) * (width - 1),
        np.mod(y, 1.0).astype(np.float32) * (height - 1),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_WRAP,
    )


def sky_day(rng: np.random.Generator) -> Canvas:
    """Blue with cumulus: clouds lie on a plane above, so that they crowd towards the horizon."""
    size = 256
    noise = cloud(rng, 512, 512, 1.75, coarsest=3.0)
    thin = cloud(rng, 512, 512, 1.3)
    faces: list[Canvas] = []
    for face in directions(size):
        up = face[..., 2]
        reach = 1.0 / np.maximum(up + 0.16, 0.05)
        x, y = 0.16 * face[..., 0] * reach, 0.16 * face[..., 1] * reach
        cover = np.clip((_sampled(noise, x, y) - 0.5) * 3.2, 0, 1)
        cover = np.clip(cover + 0.35 * (_sampled(thin, 1.7 * x, 1.7 * y) - 0.6), 0, 1)
        height = np.clip(up, 0, 1)[..., None] ** 0.55
        blue = (1 - height) * np.array([190, 208, 224], np.float32) + height * np.array([76, 126, 190], np.float32)
        shade = 205 + 45 * np.clip(_sampled(noise, x + 0.012, y + 0.012) * 1.6 - 0.5, 0, 1)
        white = shade[..., None] * np.array([0.99, 0.985, 0.98], np.float32)
        veil = (cover * np.clip(up * 9 + 0.5, 0, 1))[..., None]
        image = (1 - veil) * blue + veil * white
        faces.append(np.where(up[..., None] < -0.08, np.array([168, 172, 170], np.float32), image).astype(np.float32))
    return np.vstack(faces)


def sky_night(rng: np.random.Generator) -> Canvas:
    """Dark blue, warmer at the horizon, a few stars and thin cloud."""
    size = 256
    noise = cloud(rng, 512, 512, 1.6)
    faces: list[Canvas] = []
    for face in directions(size):
        up = np.clip(face[..., 2], 0, 1)[..., None]
        image = (1 - up) ** 3 * np.array([34, 28, 30], np.float32) + np.array([9, 12, 24], np.float32)
        reach = 1.0 / np.maximum(face[..., 2] + 0.2, 0.06)
        haze = _sampled(noise, 0.2 * face[..., 0] * reach, 0.2 * face[..., 1] * reach)
        image = image + (14 * np.clip(haze - 0.45, 0, 1) * (face[..., 2] > 0))[..., None]
        for y, x in rng.integers(0, size, (60, 2)):
            if face[y, x, 2] > 0.1:
                image[y, x] += float(rng.uniform(60, 190))
        faces.append(image.astype(np.float32))
    return np.vstack(faces)
