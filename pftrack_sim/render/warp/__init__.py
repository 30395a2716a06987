"""The renderer without OpenGL: MuJoCo Warp's ray caster, on the processor or a GPU. Imported only when chosen."""
