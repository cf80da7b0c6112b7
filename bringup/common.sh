# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
# What bringup/run and bringup/host ask of their arguments, before anything is built, and tell alike.
# They set root, the folder above this one.
: "${root:?is set by who reads this}"

# fail SENTENCE [CODE]
fail() {
  echo "bringup/$(basename "$(readlink -f "$0")"): $1" >&2
  exit "${2:-1}"
}

needs_value() { [ $# -ge 2 ] && [ -n "$2" ] && [[ $2 != --* ]] || fail "$1 needs a value; see --help" 2; }

needs_file() {
  needs_value "$@"
  [ ! -d "$2" ] || fail "$1: '$2' is a folder; a YAML file is expected" 2
  [ -f "$2" ] || fail "$1: no such file: $2" 2
}

is_number() { [[ $1 =~ ^-?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$ ]]; }

is_above_0() { is_number "$1" && [[ $1 != -* ]] && [[ ${1%%[eE]*} =~ [1-9] ]]; }

needs_whole_number() {
  needs_value "$@"
  [[ $2 =~ ^[0-9]+$ ]] || fail "$1 must be a whole number of 0 or more; is '$2'" 2
}

needs_number_above_0() {
  needs_value "$@"
  is_above_0 "$2" || fail "$1 must be a number above 0; is '$2'" 2
}

needs_number_of_0_or_more() {
  needs_value "$@"
  if ! is_number "$2" || [[ $2 == -* ]]; then fail "$1 must be a number of 0 or more; is '$2'" 2; fi
}

needs_rate() {
  needs_value "$@"
  [ "$2" = max ] || is_above_0 "$2" || fail "$1 must be 'max' or a number above 0 (1 is real time); is '$2'" 2
}

# needs_log LOG: a file or folder, or a scenario's name, with changes behind a plus. Where the programs
# are installed only they know the names.
needs_log() {
  local name=${1%%+*} folder
  [ -d "$root/config/scenarios" ] || return 0
  if [ -e "$1" ] || [ -f "$name" ]; then return 0; fi
  for folder in "${TRIGPOINT_SCENARIOS:-}" "$root/config/scenarios"; do
    [ -z "$folder" ] || [ ! -f "$folder/$name.yaml" ] || return 0
  done
  fail "$1: no such file or folder, nor a scenario; scenarios are: $(
    cd "$root/config/scenarios" && printf '%s\n' *.yaml | sed 's/\.yaml$//' | paste -sd, | sed 's/,/, /g'
  )" 2
}

# A session is never written over another: neither files nor, with two runs at once, logs/.
needs_new_folder() {
  [ ! -e "$1" ] || [ -d "$1" ] || fail "--out: '$1' is no folder" 2
  [ -z "$(ls -A "$1" 2>/dev/null)" ] || fail "--out: '$1' is not empty; give another folder, or remove it" 2
}

# how_often_failed RESTARTS_CSV
how_often_failed() {
  local lines
  lines=$(($(wc -l <"$1") - 1))
  [ $lines -eq 1 ] && echo "a process failed once" || echo "processes failed $lines times"
}

# has_failed_by_itself SESSION: for the player every SIGTERM is the user's, that of a script too which ends
# what is left after a failure. The report takes what is missing after the user's for no loss.
has_failed_by_itself() {
  [ ! -f "$1/run.yaml" ] || sed -i '/^interrupted:/d' "$1/run.yaml"
}
