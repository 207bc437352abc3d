#!/bin/sh
# Learns the shipped diagnosis anew: the quick study of the built-in aileron, whose plant equals its twin but for noise.
# Takes about two minutes. Run it when the test `the_shipped_diagnosis_is_that_of_the_built_in_study` fails.
set -eu
cd "$(dirname "$0")/../../.."
out=target/shipped
rm -rf "$out"
cargo run --release --quiet -- study paper --suite flights --scenario noise --out "$out"
gzip -9 -n -c "$out/diagnoser-noise.json" > crates/servotwin-watch/shipped/aileron.json.gz
cat "$out/study.toml" "$out/system.toml" | sha256sum | cut -c 1-64 | tr -d '\n' \
    > crates/servotwin-watch/shipped/learned-from.txt
