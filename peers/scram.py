#!/usr/bin/env python3
"""Lets SCRAM (Debian package scram) validate the fault trees of a folder and compute them again.

    python3 peers/scram.py out

SCRAM prints six significant digits, so every number is compared to half a unit of its sixth digit. That is less than
1e-9 for probabilities below 1e-3. Compared are the probability of every top event at the estimates and at both ends of
the band, the number of minimal cut sets by order, and the importance of every event.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import xml.etree.ElementTree as xml


def analysed(path):
    """SCRAM's report of a document."""
    subprocess.run(["scram", "--validate", path], check=True)
    command = ["scram", "--bdd", "--probability", "1", "--importance", "1", "--limit-order", "20", path]
    return xml.fromstring(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def is_close(own, theirs):
    """Whether a number is the other one rounded to six significant digits."""
    return abs(own - theirs) <= 0.51 * 10.0 ** -5 * abs(own) or abs(own - theirs) <= 1e-15


def compare(what, own, theirs, mistakes):
    if not is_close(own, theirs):
        mistakes.append(f"{what}: own {own}, SCRAM {theirs}")


def main(folder):
    if shutil.which("scram") is None:
        print("SCRAM is not installed: apt-get install scram", file=sys.stderr)
        return 1
    safety = pathlib.Path(folder) / "safety"
    numbers = json.loads((safety / "fault-tree.json").read_text())
    mistakes, compared, farthest = [], 0, 0.0
    for suffix, end in (("", "point"), ("-low", "low"), ("-high", "high")):
        results = analysed(safety / f"fault-tree{suffix}.xml").find("results")
        found = {one.get("name"): one for one in results.findall("sum-of-products")}
        for top in numbers["tops"]:
            name, own = top["id"], top["probability"][end]
            if name not in found:
                mistakes.append(f"{name} at {end}: SCRAM has no such top event")
                continue
            theirs = float(found[name].get("probability"))
            compare(f"P({name}) at {end}", own, theirs, mistakes)
            farthest = max(farthest, abs(own - theirs))
            compared += 1
            print(f"{name:24} {end:5}  own {own:.9e}  SCRAM {theirs:.5e}  difference {abs(own - theirs):.1e}")
            if end == "point":
                orders = [int(count) for count in (found[name].get("distribution") or "").split()]
                if orders != top["cut_set_orders"]:
                    mistakes.append(f"{name}: cut sets by order {top['cut_set_orders']}, SCRAM {orders}")
                print(f"{name:24} minimal cut sets by order: {orders}")
        if end == "point":
            for top in numbers["tops"]:
                importance = next(one for one in results.findall("importance") if one.get("name") == top["id"])
                theirs = {one.get("name"): one for one in importance}
                for own in top["importances"]:
                    if own["event"] not in theirs:
                        continue
                    event = theirs[own["event"]]
                    what = f"{top['id']}, {own['event']}"
                    compare(f"{what}: Birnbaum", own["birnbaum"], float(event.get("MIF")), mistakes)
                    compare(f"{what}: Fussell-Vesely", own["fussell_vesely"], float(event.get("CIF")), mistakes)
                    compared += 2
    print(f"{compared} numbers compared, largest difference of a probability {farthest:.1e}")
    for mistake in mistakes:
        print(mistake)
    return 1 if mistakes or compared == 0 else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "out"))
