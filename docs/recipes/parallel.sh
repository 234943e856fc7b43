#!/bin/sh
# Workers of a job on machines reached by ssh, started by GNU parallel: one on each, with all its threads.
#
#     abbe job new SCENE -o JOB
#     docs/recipes/parallel.sh JOB HOSTS image.exr
#
# HOSTS lists a machine a line as ssh knows it (":" is this one). JOB is at the same path on all of them, and abbe is installed there.
set -eu
# a machine that is lost does not end the others
parallel --sshloginfile "$2" --nonall abbe job run "$1" --no-wait -q || true
# what it has left
abbe job run "$1"
abbe job collect "$1" -o "$3"
