"""A name with markup and a script."""

HOSTILE = '<script>document.title = "taken"</script><img src=x onerror="document.title=\'taken\'">'
