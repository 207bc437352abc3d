#!/usr/bin/env bash
# Watches the live page for minutes in a real browser: its memory, what it loses, how late it draws, and what the server
# costs. Nothing else should run on the machine. Needs what run.sh needs; prints the figures as JSON.
#   peers/live_page/soak.sh [chromium|firefox] [minutes, 60 unless given]
# SERVOTWIN_BINARY names a command line that is built already.
set -euo pipefail
cd "$(dirname "$0")/../.."
browser="${1:-chromium}"
out=target/live_page
mkdir -p "$out"
if [ "$browser" = firefox ]; then package=firefox-esr; else package=chromium; fi
peers/need "$package=$package" node=nodejs npm=npm
[ -d "$out/node_modules/puppeteer-core" ] || npm install --silent --no-save --prefix "$out" puppeteer-core@25.16.0
binary="${SERVOTWIN_BINARY:-target/release/servotwin}"
[ -n "${SERVOTWIN_BINARY:-}" ] || cargo build --release --quiet --features serve
rm -f "$out/soak-$browser.link"
"$binary" serve --port 0 --out "$out/study" > "$out/soak-$browser.link" 2> "$out/soak-$browser.log" &
server=$!
trap 'kill "$server"' EXIT
until grep -qs http "$out/soak-$browser.link"; do kill -0 "$server"; sleep 0.2; done
NODE_PATH="$out/node_modules" node peers/live_page/soak.cjs "$browser" "$(cat "$out/soak-$browser.link")" "$server" "${2:-60}"
