#!/bin/sh
# Writes golden/cvode_aileron.csv and cvode_command.csv, which val_cvode_aileron_* read:
# the aileron's generated C source integrated by CVODE (peers/setup.sh installs it).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root="$here/../.."
(cd "$root" && cargo run --quiet --release -p servotwin --example write_peer_input -- "$here/generated")
cc -std=c11 -O2 -ffp-contract=off -Wall -o "$here/generated/aileron" "$here/aileron.c" \
    -lsundials_cvode -lsundials_nvecserial -lsundials_sunmatrixdense -lsundials_sunlinsoldense -lm
"$here/generated/aileron" "$here/generated/cases.txt" > "$root/golden/cvode_aileron.csv"
cp "$here/generated/command.csv" "$root/golden/cvode_command.csv"
