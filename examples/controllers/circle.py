#!/usr/bin/env python3
"""An own controller in Python: every robot drives a circle, over the pipe protocol of docs/controllers.md.

    robopheus validate examples/experiments/swap-corners.json --lab examples/lab/reference.json \
        --controller 'python3 examples/controllers/circle.py'
"""
import json
import sys


def say(message):
    print(json.dumps(message), flush=True)


def main():
    setup = json.loads(sys.stdin.readline())["setup"]["team"]
    say({"ready": {}})
    for line in sys.stdin:
        view = json.loads(line)["view"]
        turns = []
        for member in setup["robots"]:
            radius_m = max(0.3, 1.2 * member["turning_radius_m"])
            turns.append({"order": {"motion": {"twist": [0.1, 0.0, 0.1 / radius_m]}}})
        notes = [{"kind": "log", "text": "round and round"}] if view["tick"] == 0 else []
        say({"answer": {"tick": view["tick"], "robots": turns, "notes": notes}})


if __name__ == "__main__":
    main()
