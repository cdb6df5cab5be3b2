#!/usr/bin/env bash
# As docs.sh, of the pages whose fits take longer: every command as printed, every figure beside it. usage: long_docs.sh BIREFIT SOURCE_DIR
set -u
command -v python3 > /dev/null || { echo 'skipped: no python3 here (tools/setup installs it)'; exit 77; }
exec python3 "$2/tests/support/check_docs.py" run "$1" "$2" first_steps.md tutorial_droplet.md tutorial_field.md tutorial_disc.md tutorial_pockels.md tutorial_colour.md gallery.md
