#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Starts munge, slurmctld and slurmd of one node, this machine, with keys, sockets, ports and state of their own in a
# folder, and ends them. An installed cluster is not touched.
# Usage: slurm_node.sh start FOLDER [CPUS]    prints the value for SLURM_CONF
#        slurm_node.sh stop FOLDER
# Exit code 77: a program is missing (Debian: slurmctld slurmd slurm-client munge).
set -euo pipefail
export PATH=$PATH:/usr/sbin:/sbin

running() { [[ -f $1 ]] && kill -0 "$(cat "$1")" 2>/dev/null; }

stop() {
  for name in slurmctld slurmd munged; do
    file=$folder/$name.pid
    if ! running "$file"; then continue; fi
    kill "$(cat "$file")" 2>/dev/null || true
    for ((i = 0; i < 100; ++i)); do
      running "$file" || break
      sleep 0.1
    done
    if running "$file"; then kill -KILL "$(cat "$file")" 2>/dev/null || true; fi
  done
}

start() {
  for program in munged slurmctld slurmd sbatch squeue scancel sinfo; do
    command -v "$program" >/dev/null || { echo "$program is not installed" >&2; exit 77; }
  done
  mkdir -p "$folder"
  chmod 711 "$folder"  # munge wants its socket to be in reach of all users
  local user node ports
  user=$(id -un)
  node=$(hostname -s)
  # Two free ports of this machine.
  ports=($(python3 -c 'import socket
sockets = [socket.socket() for _ in range(2)]
for one in sockets: one.bind(("127.0.0.1", 0))
print(*[one.getsockname()[1] for one in sockets])'))
  head -c 128 /dev/urandom >"$folder/munge.key"
  chmod 400 "$folder/munge.key"
  mkdir -p "$folder/state" "$folder/spool"
  cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$node(127.0.0.1)
SlurmUser=$user
SlurmdUser=$user
SlurmctldPort=${ports[0]}
SlurmdPort=${ports[1]}
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerParameters=sched_interval=2,batch_sched_delay=0
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
JobCompType=jobcomp/none
MinJobAge=30
ReturnToService=2
NodeName=$node NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=4000 State=UNKNOWN
PartitionName=all Nodes=$node Default=YES MaxTime=INFINITE State=UP
CONF
  munged --socket="$folder/munge.socket" --key-file="$folder/munge.key" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munged.log" --seed-file="$folder/munge.seed" --num-threads=2
  export SLURM_CONF=$folder/slurm.conf
  slurmctld -f "$SLURM_CONF"
  slurmd -f "$SLURM_CONF" -N "$node"
  for ((i = 0; i < 300; ++i)); do
    if [[ $(timeout 5 sinfo -h -o %t 2>/dev/null) == idle ]]; then
      echo "$SLURM_CONF"
      return
    fi
    sleep 0.1
  done
  echo "the node does not become idle:" >&2
  tail -n 5 "$folder"/*.log >&2
  stop
  exit 1
}

[[ $# -ge 2 ]] || { sed -n 's/^# Usage: //p; s/^#        //p' "$0" >&2; exit 2; }
folder=$(realpath -m "$2")
cpus=${3:-$(nproc)}
case $1 in
  start) start ;;
  stop) stop ;;
  *) echo "start or stop" >&2; exit 2 ;;
esac
