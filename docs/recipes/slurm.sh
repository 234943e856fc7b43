#!/bin/sh
# Workers of a job as a Slurm array: each task takes chunks until none is free.
#
#     abbe job new SCENE -o JOB
#     array=$(sbatch --parsable --array=1-100 docs/recipes/slurm.sh JOB)
#     sbatch --dependency=afterany:$array --wrap='abbe job run JOB && abbe job collect JOB -o image.exr'
#
# The second command takes over what a task that died has left. A task that is preempted or cancelled gives its chunk back; when
# Slurm starts it again, it goes on with any other. JOB is on a disk that all nodes share.
#SBATCH --job-name=abbe
#SBATCH --array=1-4
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --requeue
exec abbe job run "$1" --no-wait --threads "${SLURM_CPUS_PER_TASK:-1}" \
    --worker "slurm-$SLURM_ARRAY_JOB_ID-$SLURM_ARRAY_TASK_ID"
