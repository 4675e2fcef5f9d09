#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the dashboard for Grafana, deploy/grafana/emitd.json, and checks the metrics in it.

Usage: dashboard.py [--check] [--metrics FILE|URL]
--check: writes nothing; exit 1 if the file differs from what would be written, if it names a metric that the sources
or deploy/docs/operations.md do not have, or one that --metrics, the answer of a running emitd, lacks
"""
import argparse
import json
import pathlib
import re
import sys
import urllib.request

import metrics_list

ROOT = pathlib.Path(__file__).resolve().parents[2]
TARGET = ROOT / "deploy/grafana/emitd.json"
OPERATIONS = ROOT / "deploy/docs/operations.md"
SOURCE = {"type": "prometheus", "uid": "${datasource}"}
HERE = '{instance=~"$instance"}'
NEEDS_PTP4L = {"emitd_ptp_offset_seconds"}  # emitd has it only while ptp4l answers
NEEDS_A_KEY = ("emitd_motion_", "emitd_ptp_")  # emitd has these only with [motion] and with clock.ptp_socket
METRIC = re.compile(r"(?<![\w])emitd_[a-z0-9_]+")


def rate(metric, more=""):
    return f'rate({metric}{{instance=~"$instance"{more}}}[$__rate_interval])'


def quantile(share, metric, by="", more=""):
    labels = f"le, {by}" if by else "le"
    return f"histogram_quantile({share}, sum by ({labels}) ({rate(metric + '_bucket', more)}))"


def per_minute(metric):
    """Returns how often something happened, as in the alarms."""
    return f"sum(increase({metric}{HERE}[1m]))"


BOUND = ("Bounds of the histograms go 1, 2, 5 from 10 us to 10 s: a quantile is right within a factor of 2.5. The exact "
         "delay of a frame is in its header and in `emit receive`.")
DEADLINE = ("vector($deadline_ms / 1000)", "deadline")

# Rows of panels: title, kind, width, unit, explanation, (expression, legend)...
ROWS = [
    ("Run", [
        ("Ready", "stat", 3, "bool_yes_no", "1 while host frames are taken; during the warm-up it is 0.",
         (f"min(emitd_ready{HERE})", "ready")),
        ("Late in this range", "stat", 3, "none", "Frames that missed their deadline.",
         (f"sum(increase(emitd_frames_late_total{HERE}[$__range]))", "late")),
        ("Lost by the host's link", "stat", 3, "none", "Host frame numbers that never arrived.",
         (f"sum(increase(emitd_host_frames_missing_total{HERE}[$__range]))", "missing")),
        ("Skipped for clients", "stat", 3, "none", "A client read slower than frames came.",
         (f"sum(increase(emitd_frames_skipped_total{HERE}[$__range]))", "skipped")),
        ("Up", "stat", 3, "s", "Time since the daemon began.", (f"min(emitd_uptime_seconds{HERE})", "up")),
        ("Scene", "table", 9, "none", "Version, scene and device of the daemon.", (f"emitd_build_info{HERE}", "")),
    ]),
    ("Frames", [
        ("Frame rate", "timeseries", 8, "hertz", "Frames handed to the sender, poses accepted, and frames sent to all "
         "clients together.",
         (f"sum({rate('emitd_frames_published_total')})", "frames"),
         (f"sum({rate('emitd_host_frames_accepted_total')})", "poses"),
         (f"sum({rate('emitd_frames_sent_total')})", "sent, all clients")),
        ("Frame time", "timeseries", 8, "s", f"From the start of rendering to pixels in memory, with the deadline that "
         f"is set above. {BOUND}",
         *[(quantile(share, "emitd_frame_seconds"), name) for share, name in ((0.5, "p50"), (0.99, "p99"),
                                                                              (0.999, "p99.9"))], DEADLINE),
        ("Stages, p99", "timeseries", 8, "s", f"wait: pose received to start of rendering; send: first to last byte, "
         f"per client. {BOUND}",
         (quantile(0.99, "emitd_stage_seconds", "stage"), "{{stage}}")),
        ("Frames flagged, per minute", "timeseries", 12, "none", "What a frame says in its header. Operations has the "
         "remedy of each.",
         *[(per_minute(f"emitd_frames_{name}_total"), name.replace("_", " "))
           for name in ("late", "repeated", "stale", "extrapolated", "motion_fault")]),
        ("Frames degraded, per minute", "timeseries", 12, "none", "Less than full quality, or heat that is coarser than "
         "the scenario asks for.",
         *[(per_minute(f"emitd_{name}_total"), name.removeprefix("frames_").replace("_", " "))
           for name in ("frames_shed", "frames_coarse", "targets_plain", "frames_entities_behind", "frames_warmed_up",
                        "poses_dropped", "device_failures")]),
        ("Coarse frames by reason, per minute", "timeseries", 12, "none", "Why the surface is coarser than the scenario "
         "asks. The log says each reason once in a run.",
         *[(per_minute(f"emitd_frames_coarse_{name}_total"), name)
           for name in ("camera", "fov", "samples", "meshes", "shade", "shadows", "weather", "edges")]),
        ("Heat beyond its formulae, frames per minute", "timeseries", 12, "none", "Moisture, snow and wind that the heat "
         "model does not hold for. Each frame says degraded.",
         *[(per_minute(f"emitd_frames_{name}_total"), name.replace("_", " "))
           for name in ("wet_unknown", "rain_shelter", "snowfall", "freezing", "melting", "humidity_unknown",
                        "strong_wind", "longwave_low", "layers_invalid")]),
    ]),
    ("Delay", [
        ("Pose to last byte", "timeseries", 8, "s", f"From the arrival of a pose to the last byte of its frame. {BOUND}",
         *[(quantile(share, "emitd_pose_to_last_byte_seconds"), name) for share, name in ((0.5, "p50"), (0.99, "p99"),
                                                                                         (0.999, "p99.9"))], DEADLINE),
        ("Jitter", "timeseries", 8, "s", f"Difference between the delays of two frames in turn. {BOUND}",
         *[(quantile(share, "emitd_delay_jitter_seconds"), name) for share, name in ((0.5, "p50"), (0.99, "p99"),
                                                                                    (0.999, "p99.9"))]),
        ("Prediction, p99", "timeseries", 8, "none", "Predicted poses of the sensor against the truth that came later: "
         "metres and radians.",
         (quantile(0.99, "emitd_prediction_error_metres"), "metres"),
         (quantile(0.99, "emitd_prediction_error_radians"), "radians")),
    ]),
    ("Clients and channels", [
        ("Rate by channel", "timeseries", 8, "hertz", "Frames sent, all clients of a channel together.",
         (f"sum by (channel) ({rate('emitd_client_frames_total')})", "{{channel}}")),
        ("Delay by client", "timeseries", 8, "s", "Delay of each connection's last frame.",
         (f"emitd_client_delay_seconds{HERE}", "{{channel}} {{transport}} {{peer}}")),
        ("Skipped by client, per minute", "timeseries", 8, "none", "A client that reads slower than frames come. Clients "
         "over UDP and shared memory show losses in `emit receive` alone.",
         (f"sum by (channel, peer) (increase(emitd_client_skipped_total{HERE}[1m]))", "{{channel}} {{peer}}")),
        ("Repairs and refusals to send, per minute", "timeseries", 12, "none", "Fragments sent again, requests refused, "
         "and datagrams that the kernel refused.",
         *[(per_minute(f"emitd_{name}_total"), name.replace("_", " "))
           for name in ("fragments_resent", "resends_refused", "send_errors", "clients_disconnected_slow")]),
        ("Bytes sent", "timeseries", 12, "Bps", "All clients.", (f"sum({rate('emitd_bytes_sent_total')})", "bytes")),
    ]),
    ("Host and triggers", [
        ("Host link, per minute", "timeseries", 8, "none", "Poses lost on the way or dropped by the kernel, and all that "
         "was refused.",
         (per_minute("emitd_host_frames_missing_total"), "missing"),
         (per_minute("emitd_host_os_drops_total"), "kernel drops"),
         (" + ".join(per_minute(metric.name) for metric in metrics_list.metrics()
                     if metric.name.startswith("emitd_refused_")), "refused")),
        ("Triggers, per minute", "timeseries", 8, "none", "Faults of the sync source.",
         *[(per_minute(f"emitd_triggers_{name}_total"), name.replace("_", " "))
           for name in ("missing", "duplicate", "too_fast", "late", "refused")]),
        ("PTP offset", "timeseries", 8, "s", "Nothing where `clock.ptp_socket` is not set.",
         (f"emitd_ptp_offset_seconds{HERE}", "offset"), (f"emitd_ptp_up{HERE}", "ptp4l answers")),
    ]),
    ("Motion simulator", [
        ("Commands and measurements", "timeseries", 6, "hertz", "The loop runs at `motion.rate_hz`.",
         (f"sum({rate('emitd_axes_commands_total')})", "commands"),
         (f"sum({rate('emitd_axes_reports_total')})", "measurements")),
        ("Lateness of commands, age of measurements", "timeseries", 6, "s", BOUND,
         (quantile(0.99, "emitd_motion_late_seconds"), "late p99"),
         (quantile(0.99, "emitd_motion_feedback_age_seconds"), "age p99")),
        ("Error of the axes and of pointing, p99", "timeseries", 6, "none", "Axis with the largest error in radians; "
         "centre of a projected image after its shift in pixels.",
         (quantile(0.99, "emitd_motion_axis_error_radians"), "axis, rad"),
         (quantile(0.99, "emitd_motion_pointing_error_pixels"), "pointing, px")),
        ("Faults, per minute", "timeseries", 6, "none", "motion.md explains each.",
         *[(per_minute(f"emitd_axes_{name}_total"), name.replace("_", " "))
           for name in ("feedback_losses", "interlocks", "commands_ignored", "commands_missed", "commands_limited",
                        "host_silences")]),
    ]),
    ("Process", [
        ("Agents at work", "timeseries", 8, "percentunit", "Share of the time in which a thread of the daemon works.",
         (f"sum by (agent) ({rate('emitd_agent_busy_seconds_total')})", "{{agent}}")),
        ("Longest turn so far", "timeseries", 8, "s", "A turn of more than 1 ms of conductor, receiver or sender is a "
         "ticket.",
         (f"emitd_agent_longest_turn_seconds{HERE}", "{{agent}}")),
        ("Memory of the journal", "timeseries", 8, "bytes", "Entries of the run that are kept for late recorders "
         "(`journal.memory_mib`). The size of the process is the "
         "system's to tell: node_exporter, or the cgroup of the unit.",
         (f"emitd_journal_memory_bytes{HERE}", "journal")),
        ("Warnings", "table", 24, "none", "Distinct warnings and errors since the start, as in the log.",
         (f"emitd_warnings_total{HERE}", "")),
    ]),
]


def panel(number, kind, title, unit, text, targets, place):
    queries = [{"datasource": SOURCE, "refId": chr(ord("A") + i), "expr": expression, "legendFormat": legend,
                "instant": kind != "timeseries", "range": kind == "timeseries",
                **({"format": "table"} if kind == "table" else {})}
               for i, (expression, legend) in enumerate(targets)]
    made = {"id": number, "type": kind, "title": title, "description": text, "datasource": SOURCE, "gridPos": place,
            "targets": queries, "fieldConfig": {"defaults": {"unit": unit}, "overrides": []}, "options": {}}
    if kind == "timeseries":
        made["fieldConfig"]["defaults"]["custom"] = {"lineWidth": 1, "fillOpacity": 5, "showPoints": "never"}
        made["fieldConfig"]["defaults"]["min"] = 0
        made["options"] = {"legend": {"displayMode": "list", "placement": "bottom"},
                           "tooltip": {"mode": "multi", "sort": "desc"}}
        if any(legend == "deadline" for _, legend in targets):
            made["fieldConfig"]["overrides"] = [
                {"matcher": {"id": "byName", "options": "deadline"},
                 "properties": [{"id": "color", "value": {"mode": "fixed", "fixedColor": "red"}},
                                {"id": "custom.lineStyle", "value": {"fill": "dash", "dash": [8, 6]}}]}]
    elif kind == "stat":
        bad_above = title not in ("Ready", "Up")
        steps = [{"color": "green", "value": None}]
        if bad_above:
            steps.append({"color": "red", "value": 0.5})
        elif title == "Ready":
            steps = [{"color": "red", "value": None}, {"color": "green", "value": 1}]
        made["fieldConfig"]["defaults"]["thresholds"] = {"mode": "absolute", "steps": steps}
        made["options"] = {"reduceOptions": {"calcs": ["lastNotNull"]}, "colorMode": "value", "graphMode": "none"}
    else:
        hidden = ["Time", "__name__", "instance", "job"]
        made["transformations"] = [{"id": "organize", "options": {"excludeByName": {name: True for name in hidden}}}]
    return made


def dashboard():
    """Returns the text of the dashboard's file."""
    panels, y = [], 0
    for title, row in ROWS:
        panels.append({"id": len(panels) + 1, "type": "row", "title": title, "collapsed": False, "panels": [],
                       "gridPos": {"h": 1, "w": 24, "x": 0, "y": y}})
        y, x = y + 1, 0
        height = 4 if title == "Run" else 8
        for name, kind, width, unit, text, *targets in row:
            if x + width > 24:
                x, y = 0, y + height
            panels.append(panel(len(panels) + 1, kind, name, unit, text, targets,
                                {"h": height, "w": width, "x": x, "y": y}))
            x += width
        y += height
    variables = [
        {"name": "datasource", "label": "Prometheus", "type": "datasource", "query": "prometheus", "current": {},
         "hide": 0, "includeAll": False, "multi": False, "options": [], "refresh": 1, "regex": "",
         "skipUrlSync": False},
        {"name": "instance", "label": "emitd", "type": "query", "datasource": SOURCE, "hide": 0, "current": {},
         "definition": "label_values(emitd_ready, instance)",
         "query": {"query": "label_values(emitd_ready, instance)", "refId": "instances"},
         "includeAll": True, "multi": True, "options": [], "refresh": 2, "regex": "", "sort": 1,
         "skipUrlSync": False},
        {"name": "deadline_ms", "label": "Deadline, ms", "type": "textbox", "query": "10", "hide": 0,
         "current": {"text": "10", "value": "10"}, "options": [{"selected": True, "text": "10", "value": "10"}],
         "skipUrlSync": False},
    ]
    made = {
        "__inputs": [], "__requires": [{"type": "grafana", "id": "grafana", "name": "Grafana", "version": "9.0.0"},
                                       {"type": "datasource", "id": "prometheus", "name": "Prometheus",
                                        "version": "1.0.0"}],
        "id": None, "uid": "emitd", "title": "emitd", "tags": ["emitd"], "schemaVersion": 36, "version": 1,
        "description": "Written by deploy/scripts/dashboard.py. deploy/docs/operations.md explains it.",
        "editable": True, "graphTooltip": 1, "time": {"from": "now-15m", "to": "now"}, "timezone": "",
        "refresh": "5s", "annotations": {"list": []}, "links": [], "fiscalYearStartMonth": 0, "liveNow": False,
        "style": "dark", "timepicker": {}, "weekStart": "",
        "templating": {"list": variables}, "panels": panels,
    }
    return json.dumps(made, indent=1, ensure_ascii=False) + "\n"


def expressions(text):
    """Yields title and expression of every query of a dashboard."""
    for each in json.loads(text)["panels"]:
        for target in each.get("targets", []):
            yield each["title"], target["expr"]


def faults(text, exposition=None):
    """Yields what is wrong with the metrics of a dashboard; exposition is the answer of /metrics."""
    known = {name for metric in metrics_list.metrics() for name in metric.samples()}
    operations = OPERATIONS.read_text(encoding="utf-8")
    groups = [each.replace("*", r"\w+") for each in re.findall(r"`([a-z_]+\*[a-z_]*)`", operations)]
    there = None if exposition is None else set(re.findall(r"^(emitd_[a-z0-9_]+)[ {]", exposition, re.MULTILINE))
    declared = set() if exposition is None else set(re.findall(r"^# TYPE (emitd_[a-z0-9_]+) ", exposition, re.MULTILINE))
    for title, expression in expressions(text):
        for name in METRIC.findall(expression):
            family = re.sub(r"_(bucket|sum|count)$", "", name)
            if name not in known:
                yield f"{title}: emitd has no metric {name}"
            plain = family.removeprefix("emitd_")
            word = re.compile(rf"(?<![a-z_])(?:emitd_)?{plain}(?:_bucket)?(?![a-z_])")
            if not word.search(operations) and not any(re.fullmatch(each, plain) for each in groups):
                yield f"{title}: deploy/docs/operations.md does not speak of {family}"
            # A family without samples, such as that of clients when there is none, has its type alone.
            if there is None or name in there or family in declared or name in NEEDS_PTP4L:
                continue
            if not any(name.startswith(each) and not any(other.startswith(each) for other in declared)
                       for each in NEEDS_A_KEY):
                yield f"{title}: the answer of /metrics lacks {name}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if something is wrong")
    parser.add_argument("--metrics", metavar="FILE|URL", help="answer of /metrics of a running emitd")
    options = parser.parse_args()
    exposition = None
    if options.metrics and re.match(r"https?://", options.metrics):
        with urllib.request.urlopen(options.metrics, timeout=10) as answer:
            exposition = answer.read().decode()
    elif options.metrics:
        exposition = pathlib.Path(options.metrics).read_text(encoding="utf-8")
    text = dashboard()
    wrong = list(faults(text, exposition))
    if options.check:
        if not TARGET.exists() or TARGET.read_text(encoding="utf-8") != text:
            wrong.append(f"{TARGET.relative_to(ROOT)} is not up to date; run {sys.argv[0]}")
    elif not wrong:
        TARGET.parent.mkdir(exist_ok=True)
        TARGET.write_text(text, encoding="utf-8")
    for fault in wrong:
        print(f"dashboard: {fault}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
