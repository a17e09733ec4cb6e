# Puts the workspace's ROS 2 environment into the bash that sources this file:
#     source scripts/ros_env.bash
# Prints nothing on success; says what is missing otherwise and returns 1.
# FASTSWING_UNDERLAY_ONLY=1 leaves the workspace's own packages out (the build uses it).
# shellcheck shell=bash

_fastswing_say() { printf 'ros_env: %s\n' "$1" >&2; }

# Without a user's other ROS distribution: its folders in every list of paths are dropped.
_fastswing_drop_foreign() {
  local kept='' entry foreign
  local IFS=:
  for entry in ${LD_LIBRARY_PATH-}; do
    for foreign in ${AMENT_PREFIX_PATH-} "$1"; do
      [[ -n $foreign && $entry/ == "$foreign"/* ]] && continue 2
    done
    kept+="${kept:+:}$entry"
  done
  LD_LIBRARY_PATH=$kept
  unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH AMENT_CURRENT_PREFIX
  unset PYTHONPATH PYTHONHOME ROS_DISTRO ROS_ETC_DIR ROS_LOCALHOST_ONLY
}

_fastswing_first_on_path() {
  local path=":$PATH:"
  path=${path//":$1:"/:}
  path=${path#:}
  PATH="$1:${path%:}"
}

_fastswing_wheels() {
  local venv=$1 libraries
  _fastswing_drop_foreign "$venv"
  libraries=$(printf '%s:' "$venv/lib" "$venv"/lib/python3.*/site-packages/ros_*.libs)
  export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH}"
  LD_LIBRARY_PATH=${LD_LIBRARY_PATH%:}
  export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv
  export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
  export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
  # The wheels hold this middleware and no other.
  export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
}

_fastswing_system() {
  [[ ${ROS_DISTRO:-jazzy} == jazzy ]] || _fastswing_drop_foreign ''
  # shellcheck disable=SC1090,SC1091
  source "$1/setup.bash"
}

_fastswing_env() {
  local root venv key value mode='' prefix='' overlay
  root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P) || return 1
  venv=$root/.venv
  overlay=$root/ros2_ws/install/local_setup.bash
  if [[ ! -r $venv/fastswing-setup ]]; then
    _fastswing_say "the workspace is not set up, or not completely; run: make build"
    return 1
  fi
  while IFS='=' read -r key value; do
    case $key in
      mode) mode=$value ;;
      ros_prefix) prefix=$value ;;
    esac
  done <"$venv/fastswing-setup"
  if [[ $mode == system ]]; then
    _fastswing_system "$prefix" || return 1
  else
    _fastswing_wheels "$venv"
  fi
  export VIRTUAL_ENV=$venv PYTHONNOUSERSITE=1
  _fastswing_first_on_path "$venv/bin"
  [[ :$PATH: == *":$root/scripts/without_ros2:"* ]] || PATH+=:$root/scripts/without_ros2
  [[ -n ${FASTSWING_UNDERLAY_ONLY-} ]] && return 0
  if [[ ! -r $overlay ]]; then
    _fastswing_say "the workspace is not built; run: make build"
    return 1
  fi
  # shellcheck disable=SC1090
  source "$overlay"
}

if [[ -z ${BASH_VERSION-} ]]; then
  echo "ros_env: source this file from bash" >&2
  return 1
fi
# ROS's own scripts use variables that are not set.
_fastswing_nounset=0
[[ $- != *u* ]] || { _fastswing_nounset=1; set +u; }
_fastswing_status=0
_fastswing_env || _fastswing_status=$?
((_fastswing_nounset)) && set -u
unset -f _fastswing_env _fastswing_system _fastswing_wheels _fastswing_first_on_path \
  _fastswing_drop_foreign _fastswing_say
eval "unset _fastswing_status _fastswing_nounset; return $_fastswing_status"
