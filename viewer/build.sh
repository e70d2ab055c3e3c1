#!/bin/sh
# Builds crates/vmao/src/report/viewer.js. The result is committed, so that building vmao needs no node.
set -eu
cd "$(dirname "$0")"
npm ci --no-audit --no-fund
node build.mjs
wc -c ../crates/vmao/src/report/viewer.js
