"""People: body proportions, clothes, triangle meshes and textures."""
