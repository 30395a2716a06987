"""A program that prints a line at the start and one for each request, whatever is asked. {pid} is its own id."""

import sys
import time

hello, *replies = sys.argv[1:]
print(hello, flush=True)
if hello == "silence":
    time.sleep(3600)
for _ in sys.stdin:
    reply = replies.pop(0) if len(replies) > 1 else replies[0]
    if reply == "die":
        sys.exit(7)
    print(reply, flush=True)
