#!/bin/sh
# The solver's processor time beside that of another commit, both built and run here,
# in turns, because a shared machine changes its speed.
# peers/beside.sh COMMIT [STRIDE] [DURATION_S] (defaults 1, 90: enough for a compiled step to be worth it)
set -eu
cd "$(dirname "$0")/.."
commit=$1
stride=${2:-1}
duration_s=${3:-90}
before=target/beside/$commit
example=crates/servotwin/examples/seconds.rs
[ -d "$before" ] || git worktree add --detach "$before" "$commit"
[ -e "$before/$example" ] || cp "$example" "$before/$example"
cargo build --release -p servotwin --example seconds
cargo build --release -p servotwin --example seconds --manifest-path "$before/Cargo.toml"
for turn in 1 2 3 4 5; do
    "$before/target/release/examples/seconds" "$stride" "$duration_s" | sed 's/^/before /'
    target/release/examples/seconds "$stride" "$duration_s" | sed 's/^/now /'
done | awk '{ print; seconds[$1] += $2; all[$1] += $2 + $3 }
    END { printf "ratio %.3f, with compilers %.3f\n", seconds["now"] / seconds["before"], all["now"] / all["before"] }'
