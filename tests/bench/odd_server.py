"""A process that does what it is told to: answers, waits for ever, computes for ever, grows, dies, prints."""

import json
import os
import sys
import time

from pmviewer.bench.guarded import requests


def main() -> None:
    for request in requests():
        what = request["do"]
        if what == "wait":
            time.sleep(1000)
        elif what == "compute":
            while True:
                pass
        elif what == "grow":
            held = []
            while True:
                held.append(b"x" * 10_000_000)
        elif what == "die":
            print("what a pity", file=sys.stderr, flush=True)
            os._exit(3)
        print(json.dumps({"pid": os.getpid(), "said": request.get("say")}), flush=True)


if __name__ == "__main__":
    main()
