# Run the Python on the standard input with these packages in a temporary folder: `. findings/run.sh PACKAGE ... < FILE`.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "$@"
cd "$folder"
"$folder/venv/bin/python" -W ignore -
