#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Reports what this host lacks for emitd's low_latency profile: one row per item with the command
# that mends it. Changes nothing and needs no rights, but run it as the user that emitd runs as:
# limits are that user's.
#   check_host.sh [--frame-mib N]     N: size of a frame, for the socket buffers (default 2)
# Exit: 0 all well, 1 something to warn of (more jitter), 2 something that [realtime] will be
# refused or that makes instants wrong; 64 usage.
set -uo pipefail

frame_mib=2
while [[ $# -gt 0 ]]; do
  case $1 in
    --frame-mib) frame_mib=${2:-}; shift; shift || true ;;
    --help | -h) sed -n '3,8s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) echo "check_host.sh: unknown argument '$1'" >&2; exit 64 ;;
  esac
done
if ! [[ $frame_mib =~ ^[1-9][0-9]{0,3}$ ]]; then
  echo "check_host.sh: --frame-mib takes a number of 1 to 9999" >&2
  exit 64
fi

worst=0
# row SEVERITY(pass|warn|fail) ITEM FOUND REMEDY
row() {
  local remedy=$4
  case $1 in
    pass) remedy="" ;;
    warn) ((worst < 1)) && worst=1 ;;
    fail) worst=2 ;;
  esac
  printf '%-5s %-24s %-34s %s\n' "$1" "$2" "$3" "$remedy"
}
read_file() { if [[ -r $1 ]]; then tr '\0\n' '  ' <"$1" | sed 's/ *$//'; fi; }
is_root() { [[ $(id -u) -eq 0 ]]; }

printf '%-5s %-24s %-34s %s\n' "" item found remedy

# Limits of this user.
rtprio=$(ulimit -r)
if chrt -f 50 true 2>/dev/null; then
  row pass RLIMIT_RTPRIO "$rtprio" ""
else
  row fail RLIMIT_RTPRIO "$rtprio" "LimitRTPRIO=60 in the unit, or /etc/security/limits.conf: USER - rtprio 60"
fi
memlock=$(ulimit -l)
if [[ $memlock == unlimited ]] || is_root; then
  row pass RLIMIT_MEMLOCK "$memlock KiB" ""
else
  row fail RLIMIT_MEMLOCK "$memlock KiB" "LimitMEMLOCK=infinity in the unit, or limits.conf: USER - memlock unlimited"
fi
runtime=$(read_file /proc/sys/kernel/sched_rt_runtime_us)
if [[ -z $runtime ]]; then
  row warn sched_rt_runtime_us unknown "-"
elif [[ $runtime -eq 0 ]]; then
  row fail sched_rt_runtime_us 0 "sysctl -w kernel.sched_rt_runtime_us=950000"
else
  row pass sched_rt_runtime_us "$runtime" ""
fi

# Socket buffers: four frames in, a burst of frames out. In a network namespace of a container
# these files may be missing.
need=$((4 * frame_mib * 1024 * 1024))
for name in rmem_max wmem_max; do
  have=$(read_file /proc/sys/net/core/$name)
  if [[ -z $have ]]; then
    row warn "net.core.$name" "not visible here" "look in the host's own network namespace"
  elif [[ $have -ge $need ]]; then
    row pass "net.core.$name" "$have" ""
  else
    row warn "net.core.$name" "$have, $need wanted" "sysctl -w net.core.$name=$need"
  fi
done

# BBR spreads frames out: emitd's TCP clients have cubic or reno where it may choose.
system=$(read_file /proc/sys/net/ipv4/tcp_congestion_control)
instead=$(python3 - 2>/dev/null <<'PY'
import socket
for name in (b"cubic", b"reno"):
    try:
        socket.socket().setsockopt(socket.IPPROTO_TCP, socket.TCP_CONGESTION, name)
    except OSError:
        continue
    print(name.decode())
    break
PY
)
case $system in
  "") row warn "TCP congestion control" "not visible here" "look in the host's own network namespace" ;;
  bbr*)
    if [[ -n $instead ]]; then
      row pass "TCP congestion control" "$system (emitd's clients: $instead)" ""
    else
      row warn "TCP congestion control" "$system" "sysctl -w net.ipv4.tcp_allowed_congestion_control=\"\$(sysctl -n net.ipv4.tcp_allowed_congestion_control) reno\""
    fi ;;
  *) row pass "TCP congestion control" "$system" "" ;;
esac

# Processor.
governors=$(cat /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor 2>/dev/null | sort -u | tr '\n' ' ')
governors=${governors% }
case $governors in
  "") row pass "CPU governor" "none: frequency is not scaled here" "" ;;
  performance) row pass "CPU governor" performance "" ;;
  *) row warn "CPU governor" "$governors" "cpupower frequency-set -g performance" ;;
esac
isolated=$(read_file /sys/devices/system/cpu/isolated)
if [[ -n $isolated ]]; then
  row pass "isolated cores" "$isolated" ""
else
  row warn "isolated cores" none "kernel command line: isolcpus=managed_irq,domain,2-3 nohz_full=2-3 rcu_nocbs=2-3, then realtime.cpus"
fi
deep=0
for state in /sys/devices/system/cpu/cpu0/cpuidle/state*/; do
  [[ -r $state/latency && -r $state/disable ]] || continue
  if [[ $(<"$state/latency") -gt 20 && $(<"$state/disable") -eq 0 ]]; then deep=$((deep + 1)); fi
done
if [[ $deep -eq 0 ]]; then
  row pass "C-states" "none slower than 20 us to leave" ""
else
  row warn "C-states" "$deep slower than 20 us to leave" "cpupower idle-set -D 20"
fi

# Kernel.
if [[ $(read_file /sys/kernel/realtime) == 1 ]] || uname -v | grep -q PREEMPT_RT; then
  row pass PREEMPT_RT yes ""
else
  row warn PREEMPT_RT "no ($(uname -r))" "apt-get install linux-image-rt-amd64"
fi
thp=$(read_file /sys/kernel/mm/transparent_hugepage/enabled | grep -o '\[[a-z]*\]' | tr -d '[]')
case $thp in
  "" | never | madvise) row pass "transparent huge pages" "${thp:-none}" "" ;;
  *) row warn "transparent huge pages" "$thp" "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled" ;;
esac
slack=$(read_file /proc/self/timerslack_ns)
row pass "timer slack" "${slack:-?} ns (emitd: 1 ns)" ""
swaps=$(tail -n +2 /proc/swaps 2>/dev/null | wc -l)
if [[ $swaps -eq 0 ]]; then
  row pass swap none ""
else
  row warn swap "$swaps in use" "swapoff -a, or realtime.lock_memory = true"
fi

# Interrupts: a balancer moves them onto isolated cores again.
if pgrep -x irqbalance >/dev/null 2>&1; then
  row warn "IRQ affinity" "irqbalance runs" "IRQBALANCE_BANNED_CPULIST=2-3 in /etc/default/irqbalance"
elif [[ -n $isolated ]]; then
  default=$(read_file /proc/irq/default_smp_affinity)
  row pass "IRQ affinity" "default mask ${default:-?}" ""
else
  row pass "IRQ affinity" "no irqbalance" ""
fi

# Time.
if pgrep -x ptp4l >/dev/null 2>&1; then
  row pass "PTP daemon" "ptp4l runs" ""
else
  row warn "PTP daemon" "no ptp4l" "apt-get install linuxptp; systemctl enable --now ptp4l@IFACE phc2sys@IFACE"
fi
offset=$(python3 - 2>/dev/null <<'PY'
import time
print(round(time.clock_gettime(11) - time.clock_gettime(time.CLOCK_REALTIME)))
PY
)
case $offset in
  "") row warn "TAI offset" "unknown: no python3" "adjtimex --print | grep tai" ;;
  0) row fail "TAI offset" "0: instants are UTC" "phc2sys -w, or chrony with 'leapsectz right/UTC'" ;;
  *) row pass "TAI offset" "$offset s" "" ;;
esac
exit "$worst"
