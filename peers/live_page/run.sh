#!/usr/bin/env bash
# Drives the live page in real browsers as a user would. Needs node, npm and Debian's chromium or firefox-esr; what is
# missing is installed with apt-get. Writes screenshots into target/live_page.
#   peers/live_page/run.sh [chromium|firefox]
# SERVOTWIN_BINARY names a command line that is built already.
set -euo pipefail
cd "$(dirname "$0")/../.."
browser="${1:-chromium}"
out=target/live_page
mkdir -p "$out"
if [ "$browser" = firefox ]; then package=firefox-esr; else package=chromium; fi
peers/need "$package=$package" node=nodejs npm=npm
npm install --silent --no-save --prefix "$out" puppeteer-core@25.16.0
binary="${SERVOTWIN_BINARY:-target/release/servotwin}"
[ -n "${SERVOTWIN_BINARY:-}" ] || cargo build --release --quiet --features serve
look() { NODE_PATH="$out/node_modules" node peers/live_page/test.cjs "$browser" "$2" "$out" "$1"; }
# Serves the page with these arguments, and visits it.
visit() {
    visit_what=$1
    shift
    rm -f "$out/link" # the one of an earlier visit leads nowhere
    "$binary" serve --port 0 "$@" > "$out/link" 2> "$out/server.log" &
    server=$!
    trap 'kill "$server"' EXIT
    until grep -qs http "$out/link"; do kill -0 "$server"; sleep 0.2; done
    look "$visit_what" "$(cat "$out/link")"
    kill "$server"
    wait "$server" || true
    trap - EXIT
}
visit flight --out "$out/study"
visit embedded --out "$out/study"
look saved ''
"$binary" simulate aileron_dual --command noise:rms=4deg,bandwidth=0.7Hz,seed=5 --noise 4 \
    --fault actuator_1.leakage_a.leakage=0.5@4s --duration 8s --out "$out/leak.csv" > /dev/null
"$binary" watch "$out/leak.csv" --html "$out/leak.html" > /dev/null 2>> "$out/server.log"
look record "$PWD/$out/leak.html"
