"""The sky's picture, as bright as the light has it."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np

from pftrack_sim.scene.layout import SKY


def sky_material(model: mujoco.MjModel) -> int:
    """Index of the material whose emission is the brightness of the sky; -1 where there is none."""
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, SKY)


class Sky:
    """Keeps OpenGL's picture of the sky as bright as the model says.

    OpenGL draws a sky without light on it, so its picture itself is made brighter or darker.

    Args:
        model: The compiled scene, with the picture at brightness 1.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._material = sky_material(model)
        pictures = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
        self._texture = int(pictures[0]) if self._material >= 0 and pictures.size else -1
        self._shown = 1.0

    def update(self, drawing: mujoco.MjrContext) -> None:
        """Hand the picture over again if its brightness has changed. The context is current; the model is left as is.

        Args:
            drawing: Where the model's textures were loaded at brightness 1.
        """
        if self._texture < 0:
            return
        model, texture = self._model, self._texture
        wanted = float(model.mat_emission[self._material])
        if wanted == self._shown:
            return
        start = int(model.tex_adr[texture])
        size = int(model.tex_width[texture]) * int(model.tex_height[texture]) * int(model.tex_nchannel[texture])
        picture = model.tex_data[start : start + size]
        original = picture.copy()
        levels = np.clip(np.round(np.arange(256) * wanted), 0.0, 255.0).astype(np.uint8)
        picture[:] = cv2.LUT(original, levels).reshape(-1)
        mujoco.mjr_uploadTexture(model, drawing, texture)
        picture[:] = original
        self._shown = wanted
