"""Settings of small episodes, and a name with markup and a script."""

HOSTILE = '<script>document.title = "taken"</script><img src=x onerror="document.title=\'taken\'">'

SMALL = {"duration_s": 0.8, "camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "occluders": []}
