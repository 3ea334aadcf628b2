# Sourced by tools/run and tools/test: makes $root/.venv with the pinned packages on first use, or when they changed.
root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)"
venv="$root/.venv"
lock="$root/tools/requirements.lock"
stamp="$venv/installed-from"

say() { echo "landing-sim: $*" >&2; }

suitable() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }

find_python() {
  local candidate
  for candidate in ${PYTHON:+"$PYTHON"} python3.11 python3.12 python3.13 python3.14 python3 python; do
    if suitable "$candidate"; then
      echo "$candidate"
      return
    fi
  done
  say "Python 3.11 or newer is needed and none was found on the PATH (python3 is: $(python3 --version 2>&1 || true))."
  say "Install one, or name it: PYTHON=/path/to/python3.11 $0"
  return 1
}

prepare() {
  if [ -f "$stamp" ] && cat -- "$lock" "$root/pyproject.toml" | cmp -s - "$stamp" && suitable "$venv/bin/python"; then
    return
  fi
  if ! suitable "$venv/bin/python"; then
    local python
    python="$(find_python)" || exit 1
    if ! "$python" -c 'import venv, ensurepip' >/dev/null 2>&1; then
      say "$python lacks the venv module; on Debian or Ubuntu: apt install python3-venv"
      exit 1
    fi
    say "first use: creating .venv with $("$python" --version 2>&1)"
    "$python" -m venv --clear "$venv"
  fi
  rm -f -- "$stamp"
  say "installing $(grep -c == "$lock") packages, hashes checked, into .venv (about 400 MB to download; some minutes)"
  local pip=("$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input)
  if ! PIP_USER=0 "${pip[@]}" --require-hashes --requirement "$lock"; then
    say "installation failed; nothing else was changed. Fix the cause above and run the command again."
    exit 1
  fi
  PIP_USER=0 "${pip[@]}" --no-deps --no-build-isolation --no-index --editable "$root"
  cat -- "$lock" "$root/pyproject.toml" >"$stamp"
  say "ready"
}

# Small matrices: threads inside BLAS cost more than they bring, and sums must not depend on their number.
export OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}" OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"
