"""A name that tries to be more than a name."""

HOSTILE = '<script>document.title = "taken"</script><img src=x onerror="document.title=\'taken\'">'
