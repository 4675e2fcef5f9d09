# SPDX-License-Identifier: Apache-2.0
"""Tables of measured results as Markdown, from the JSON files that `emit bench` writes.

Run it by deploy/scripts/measured_pages.sh from the root of the repository. A new JSON file needs an entry in FILES.
"""
import difflib
import json
import math
import pathlib
import re
import subprocess
import sys

# File of results: what it shows, and the command that repeats it.
FILES = {
    "renderer/docs/measured": {
        "paper-statue-90": (
            "The published benchmark: a statue of 1.1 million triangles, 90 steps of history. Errors are against a "
            "converged, ray-traced history.",
            "emit bench paper --scene statue --steps 90"),
        "paper-statue-90-h200": (
            "The same on a GPU.",
            "emit bench paper --scene statue --steps 90"),
        "paper-box-27": (
            "The published benchmark: a box of 45 triangles, 27 steps of history.",
            "emit bench paper --scene box --steps 27 --no-errors"),
        "paper-box-27-h200": (
            "The same on a GPU.",
            "emit bench paper --scene box --steps 27 --no-errors"),
        "error-vs-time-block": (
            "Error, in kelvin and in per cent of the radiance, and frame time of every method and setting against "
            "three-dimensional conduction, whole image. "
            "`embree` recomputes the history with one ray per pixel and step; its time is that of the rays alone.",
            "emit bench error-vs-time --quick --scene block-on-road --frames 3 --refine 0.5"),
        "error-vs-time-ribbed": (
            "The same at a wall of thin ribs by night.",
            "emit bench error-vs-time --quick --scene ribbed --frames 3 --refine 0.5"),
        "error-vs-time-block-h200": (
            "The same on a GPU. `embree` traces with its 16 cores.",
            "emit bench error-vs-time --quick --scene block-on-road --frames 3 --refine 0.5"),
        "thermal-truth": (
            "What must not change a temperature: splitting the history, moving the camera, a restart. And the print of "
            "a vehicle after it has left, against the converged history.",
            "emit bench thermal-truth"),
        "subpixel": (
            "Energy of a small target above its background, against the solid angle of its faces: random places and "
            "attitudes, then the largest change from frame to frame while it closes in by 1 % a frame. `window` is the "
            "renderer's way, `centre` one sample per pixel (`sensor.small_target_px = 0`).",
            "emit bench subpixel"),
        "scaling": (
            "Frame time over one quantity at a time. Ratios are medians of interleaved pairs of frames.",
            "emit bench scaling --method cached"),
        "scaling-h200": (
            "The same on a GPU, without the axis of triangles. A frame of a third of a millisecond shows what the "
            "processor does for every object.",
            "emit bench scaling --method cached --axis steps --axis pixels --axis objects --axis samples"),
        "uncertainty": (
            "What the uncertainty of each input does to the surfaces of a picture, with each input at both ends of its "
            "range and all others as they are.",
            "emit bench uncertainty block-on-road"),
        "uncertainty-airfield": (
            "The same of the demonstration's scene, with coarse surfaces: the figures are differences of pictures that "
            "have the same surfaces.",
            "emit bench uncertainty airfield --time-s 6 --set thermal.tolerance_k=8 \\\n"
            "  --set thermal.max_samples=60000 --set sensor.width_px=320 --set sensor.height_px=256"),
        "gas": (
            "Frame time of the scenario `decoys` with each kind of gas, beside the same scene without gas.",
            "emit bench gas"),
        "crowd": (
            "The airfield alone and with ten thousand figures of a thousand triangles each.",
            "emit bench crowd"),
        "crowd-h200": (
            "The same on a GPU.",
            "emit bench crowd"),
        "turn": (
            "The longest frame of a full turn of the camera in one second over the airfield, and after jumps.",
            "emit bench turn"),
        "turn-h200": (
            "The same on a GPU.",
            "emit bench turn"),
        "budget": (
            "Frames with a deadline: share that was in time, and the error that the quality levels cost.",
            "emit bench budget"),
        "budget-h200": (
            "The same on a GPU, where the coarsest quality level saves no more than a fifth of the time: the policy gives "
            "up 3 K for it, and most frames are late all the same.",
            "emit bench budget"),
        "live-weather": (
            "A cloud that passes over the airfield: the host sends the weather every 5 s, or the script has it.",
            "emit bench live --weather-every 5 --seconds 40 --rate 25 --set thermal.max_samples=400000"),
    },
    "server/docs/measured": {
        "stream": (
            "Delay of four clients at 200 Hz, then throughput at full speed beside other programs on the same machine.",
            "emit bench stream --transport mixed --frames 3000 --repeats 9"),
        "stream-640x512-200hz-60s": (
            "One minute of four clients at 200 Hz.",
            "emit bench stream --transport mixed --frames 12000 --repeats 0"),
        "stream-1024x768-100hz-60s": (
            "One minute of four clients at 100 Hz, 1024x768.",
            "emit bench stream --transport mixed --width 1024 --height 768 --rate 100 --frames 6000 --repeats 0"),
        "stream-loss": (
            "UDP in datagrams of 1400 bytes through a network that loses 1 %.",
            "emit bench stream --loss 0.01 --frames 2000"),
        "isolation": (
            "What a stopped client and a flooding client cost the others.",
            "emit bench isolation --pairs 15"),
    },
}


class Problem(Exception):
    """A fault of the input, with the file and what to do about it."""


def number(value, digits=3):
    """Value with so many significant digits and without an exponent; a dash where there is none."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if value == 0:
        return "0"
    if isinstance(value, int):
        return f"{value:,}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:,.{decimals}f}"


def percent(fraction, decimals=1):
    return "-" if fraction is None else f"{100 * fraction:.{decimals}f} %"


def field(name, digits=3, scale=1.0):
    """Reader of one member of a row."""
    def read(row):
        value = row.get(name)
        return number(value * scale if isinstance(value, float) else value, digits)
    return read


def table(columns, rows):
    lines = ["| " + " | ".join(header for header, _ in columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(read(row) for _, read in columns) + " |" for row in rows]
    return lines


MILLISECONDS = 1e-3  # from microseconds


def paper_tables(rows):
    def stage(name):
        return lambda row: number(row["stages_ms"][name])
    yield table([("scene", field("scene")), ("triangles", field("triangles")), ("steps", field("steps")),
                 ("method", field("method")), ("frame, ms", field("frame_ms_median")),
                 ("longest, ms", field("frame_ms_max")), ("RMS, K", field("rms_error_k", 2)),
                 ("p99, K", field("p99_error_k", 2)), ("Embree, ms a step", field("embree_step_ms_median"))], rows)
    yield table([("stages in ms", field("method")), ("geometry", stage("geometry")),
                 ("obscurance", stage("occlusion")), ("shadow maps", stage("shadow")), ("thermal", stage("thermal")),
                 ("radiance", stage("radiance")), ("read-back", stage("readback"))], rows)


def error_tables(rows):
    def share(name):
        return lambda row: percent(row[name], 2).removesuffix(" %")
    yield table([("method", field("method")), ("model", field("model")), ("steps", field("steps")),
                 ("spacing", field("spacing")), ("lateral", field("lateral")),
                 ("frame, ms", field("frame_ms_median")), ("RMS, K", field("rms_error_k", 2)),
                 ("p99, K", field("p99_error_k", 2)), ("RMS, %", share("rms_error_frac")),
                 ("p99, %", share("p99_error_frac")), ("nothing beats it", field("pareto"))],
                [row for row in rows if row["region"] == "all"])


def truth_tables(rows):
    def after(row):
        return number(row["left_s"] / 60, 1) + " min" if "left_s" in row else "-"
    yield table([("test", field("test")), ("after", after), ("method", field("method")), ("steps", field("steps")),
                 ("p99, K", field("p99_error_k", 2)), ("max, K", field("max_error_k", 2))], rows)


def subpixel_tables(rows):
    def worst(name):
        def read(row):
            return percent(row[name], 2)
        return read
    # The largest figures of all quality levels stand in one row of each method and size.
    worst_rows = {}
    for row in rows:
        key = (row["method"], row["size_px"])
        kept = worst_rows.setdefault(key, dict(row, levels=0))
        kept["levels"] += 1
        for name in ("rms_energy_error_frac", "absent_frac", "step_frac"):
            kept[name] = max(kept[name], row[name])
    yield table([("size, px", field("size_px")), ("method", field("method")), ("quality levels", field("levels")),
                 ("RMS of the energy", worst("rms_energy_error_frac")), ("absent", worst("absent_frac")),
                 ("largest step", worst("step_frac")), ("one target costs", lambda row: percent(row["cost_frac"]))],
                list(worst_rows.values()))


def scaling_tables(rows):
    def itself(row):
        ratio = row["self_ratio"]
        return "-" if ratio is None else f"{ratio:.3f} +- {row['self_ratio_spread']:.3f}"
    yield table([("quantity", field("axis")), ("value", field("value")), ("scene", field("scene")),
                 ("frame, ms", field("frame_ms_median")), ("ratio to the row above", field("ratio_to_previous")),
                 ("a run against itself", itself), ("limit", field("limit_ratio")), ("met", field("limit_met"))], rows)


def crowd_tables(rows):
    yield table([("scene", field("scene")), ("triangles", field("triangles")), ("instances", field("instances")),
                 ("samples", field("samples")), ("MiB", field("sample_mib")), ("warm-up, s", field("warm_up_s")),
                 ("frame, ms", field("frame_ms_median")), ("ratio", field("ratio"))], rows)


def gas_tables(rows):
    yield table([("gas", field("gas")), ("puffs", field("puffs")), ("frame, ms", field("frame_ms_median")),
                 ("ratio", field("ratio")), ("spread", field("self_ratio_spread"))], rows)


def uncertainty_tables(rows):
    for band in dict.fromkeys(row["band"] for row in rows):
        acting = [row for row in rows if row["band"] == band and row["acts"]]
        yield table([("band", field("band")), ("input", field("input")), ("range", field("range")),
                     ("low end, mean K", field("delta_low_k")), ("high end, mean K", field("delta_high_k")),
                     ("RMS, K", lambda row: field("rms")({"rms": max(row["rms_low_k"], row["rms_high_k"])})),
                     ("source of the range", field("source"))], acting)


def turn_tables(rows):
    yield table([("case", field("case")), ("budget, ms", field("budget_ms")), ("frame, ms", field("frame_ms_median")),
                 ("longest, ms", field("frame_ms_max_median_of_runs")), ("longest / median", field("ratio")),
                 ("frames", field("frames")), ("late", field("late_frames")),
                 ("below full quality", field("shed_frames"))], rows)


def budget_tables(rows):
    yield table([("budget / free median", field("budget_frac")), ("budget, ms", field("budget_ms")),
                 ("in time", lambda row: percent(row["within_frac"])), ("frame, ms", field("frame_ms_median")),
                 ("longest, ms", field("frame_ms_max")), ("error, K", field("error_k_median", 2)),
                 ("estimate within a factor of 2", lambda row: percent(row["estimate_within_factor_2_frac"]))], rows)


def live_tables(rows):
    yield table([("weather from", field("driven_by")), ("frame, ms", field("frame_ms_median")),
                 ("p99, ms", field("frame_ms_p99")), ("longest, ms", field("frame_ms_max")),
                 ("RMS, K", field("error_rms_k", 2)), ("p99, K", field("error_p99_k", 2)),
                 ("warm-up, s", field("warm_up_s"))], rows)


def stream_tables(rows):
    paced = [row for row in rows if row["rate_hz"] is not None]
    lossy = [row for row in rows if "loss_frac" in row]
    full = [row for row in rows if row["rate_hz"] is None and "loss_frac" not in row]

    def ms(name):
        return field(name, 3, MILLISECONDS)

    def size(row):
        return f"{row['width']}x{row['height']}"

    def ratios(row):
        return ", ".join(f"{value:.2f} of `{name}`" for name, value in row.get("ratios", {}).items()) or "-"
    if paced:
        yield table([("delay in ms", field("transport")), ("image", size), ("frames", field("frames")),
                     ("lost", field("lost")), ("late", field("late")), ("p50", ms("p50_us")), ("p99", ms("p99_us")),
                     ("p99.9", ms("p999_us")), ("own p50", ms("own_p50_us")), ("own p99", ms("own_p99_us")),
                     ("own p99.9", ms("own_p999_us"))], paced)
    if full:
        yield table([("throughput", field("transport")), ("Gbit/s", field("gbit_s")), ("least", field("min_gbit_s")),
                     ("most", field("max_gbit_s")), ("CPU cores", field("cpu_frac"))], full)
        yield table([("median ratio of a round", field("transport")), ("ratios", ratios)],
                    [row for row in full if "ratios" in row])
    if lossy:
        yield table([("with 1 % loss", field("transport")), ("frames", field("frames")),
                     ("whole", lambda row: percent(row["whole_frac"], 2)), ("partial", field("partial")),
                     ("partial, not flagged", field("unflagged")), ("wrong pixels", field("wrong_px")),
                     ("resent", field("resent")), ("Gbit/s", field("gbit_s"))], lossy)


def isolation_tables(rows):
    def spread(row):
        return f"{row['ratio']:.3f} ({row['ratio_p16']:.3f} to {row['ratio_p84']:.3f})"

    def itself(row):
        return f"{row['self_ratio']:.3f} +- {row['self_spread']:.3f}"
    yield table([("frames", field("frames")), ("lost", field("lost")),
                 ("p99 interval alone, ms", field("quiet_p99_us", 3, MILLISECONDS)),
                 ("beside them, ms", field("disturbed_p99_us", 3, MILLISECONDS)), ("ratio (68 %)", spread),
                 ("a run against itself", itself)], rows)


TABLES = {"paper": paper_tables, "error-vs-time": error_tables, "thermal-truth": truth_tables,
          "subpixel": subpixel_tables, "scaling": scaling_tables, "crowd": crowd_tables, "gas": gas_tables,
          "uncertainty": uncertainty_tables, "turn": turn_tables,
          "budget": budget_tables, "live": live_tables, "stream": stream_tables, "isolation": isolation_tables}


def load(folder):
    """Results of a folder by name, in the order of FILES."""
    found = {path.stem: path for path in sorted(pathlib.Path(folder).glob("*.json"))}
    for name, path in found.items():
        if name not in FILES[folder]:
            raise Problem(f"{path}: no entry in FILES of deploy/scripts/measured_pages.py: add what it shows and the "
                          "command that repeats it")
    results = {}
    for name in FILES[folder]:
        if name not in found:
            raise Problem(f"{folder}/{name}.json is missing: remove its entry in deploy/scripts/measured_pages.py")
        try:
            results[name] = json.loads(found[name].read_text())
            if results[name]["suite"] not in TABLES:
                raise Problem(f"{found[name]}: suite '{results[name]['suite']}' has no table in measured_pages.py")
        except (ValueError, KeyError) as error:
            raise Problem(f"{found[name]}: no result of emit bench: {error}") from error
    return results


def date_of(commit, page):
    """Day of a commit. A clone without that commit takes the day that the page has already."""
    commit_only = commit.removesuffix("-dirty")
    git = subprocess.run(["git", "show", "-s", "--format=%cs", f"{commit_only}^{{commit}}"], capture_output=True,
                         text=True, check=False)
    if git.returncode == 0 and git.stdout.strip():
        return git.stdout.strip()
    known = re.search(rf"commit `{re.escape(commit_only)}[^`]*`\s+of\s+(\d{{4}}-\d{{2}}-\d{{2}})", page)
    return known.group(1) if known else "an unknown date"


def measured_section(folder, page):
    lines = []
    for name, result in load(folder).items():
        about, command = FILES[folder][name]
        lines += [f"### {name}", "", *wrapped(about), "", "```", command, "```", ""]
        try:
            for rows in TABLES[result["suite"]](result["results"]):
                lines += [*rows, ""]
        except (KeyError, TypeError) as error:
            raise Problem(f"{folder}/{name}.json: a row lacks {error}") from error
        commit = result["commit"]
        lines += wrapped(f"Device: {result['device']}. Build: commit `{commit}` of {date_of(commit, page)}. "
                         f"Data: [{name}.json]({name}.json).")
        lines.append("")
    return lines


def wrapped(text, width=120):
    lines, line = [], ""
    for word in text.split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}" if line else word
    return lines + [line]


def pick(result, **wanted):
    rows = [row for row in result["results"] if all(row.get(key) == value for key, value in wanted.items())]
    if len(rows) != 1:
        raise Problem(f"{len(rows)} rows with {wanted} where README.md needs one")
    return rows[0]


def readme_section(_page):
    """The few figures of README.md."""
    renderer, server = load("renderer/docs/measured"), load("server/docs/measured")
    statue, block, scaling = (renderer[name] for name in ("paper-statue-90", "error-vs-time-block", "scaling"))
    gpu = renderer["paper-statue-90-h200"]
    gpu_cached, gpu_published = pick(gpu, method="cached"), pick(gpu, method="per-frame")
    cached = pick(statue, method="cached")
    published = pick(statue, method="per-frame")
    near = pick(block, region="all", method="cached", lateral=True)
    far = pick(block, region="all", method="per-frame", model="foster", steps=27, spacing="uniform")
    rays = pick(block, region="all", method="embree", model="foster", steps=27)
    steps = pick(scaling, axis="steps", value=54)["ratio_to_previous"]
    steps *= pick(scaling, axis="steps", value=108)["ratio_to_previous"]
    triangles = pick(scaling, axis="triangles", value=1000000)["ratio_to_previous"]
    triangles *= pick(scaling, axis="triangles", value=10000000)["ratio_to_previous"]
    tcp = pick(server["stream"], transport="tcp")["ratios"]
    shm = pick(server["stream"], transport="shm")["ratios"]
    minute = server["stream-640x512-200hz-60s"]
    own = pick(minute, transport="mixed")
    bare = pick(minute, transport="bare-tcp-paced")
    whole = {row["transport"]: row["whole_frac"] for row in server["stream-loss"]["results"]}
    isolation = server["isolation"]["results"][0]
    embree_s = cached["embree_step_ms_median"] * cached["steps"] / 1000
    gpu_embree_s = gpu_cached["embree_step_ms_median"] * gpu_cached["steps"] / 1000
    rows = [
        ("frame, 1.1 M triangles, 90 steps of history", f"{number(cached['frame_ms_median'], 2)} ms",
         f"published method {published['frame_ms_median'] / 1000:.1f} s; Embree {embree_s:.1f} s", "statue"),
        ("its error, RMS / p99", f"{cached['rms_error_k']:.2f} / {cached['p99_error_k']:.2f} K",
         f"published method {published['rms_error_k']:.2f} / {published['p99_error_k']:.2f} K", "statue"),
        ("this frame on a GPU", f"{number(gpu_cached['frame_ms_median'], 2)} ms",
         f"published method {gpu_published['frame_ms_median']:.0f} ms; Embree on 16 cores {gpu_embree_s:.1f} s",
         "gpu"),
        ("RMS to 3-D conduction", f"{near['rms_error_k']:.2f} K in {number(near['frame_ms_median'], 2)} ms",
         f"per frame {far['rms_error_k']:.2f} K in {far['frame_ms_median']:.0f} ms; "
         f"Embree {rays['rms_error_k']:.2f} K in {rays['frame_ms_median']:.0f} ms", "block"),
        ("frame time for 4 times the history", f"x {steps:.2f}", "published method: in proportion", "scaling"),
        ("frame time for 100 times the triangles", f"x {triangles:.2f}", "equal coverage of the image", "scaling"),
        (f"TCP throughput, system with {server['stream']['yardstick_congestion_control'].upper()}",
         f"{tcp['zeromq']:.2f} of ZeroMQ",
         f"{tcp['zeromq-crc']:.2f} of ZeroMQ with a checksum; {tcp['iperf3']:.2f} of iperf3", "stream"),
        ("one minute, 4 clients, 200 Hz, own delay p99.9", f"{own['own_p999_us'] / 1000:.1f} ms, {own['lost']} lost",
         f"bare sending threads {bare['own_p999_us'] / 1000:.1f} ms", "minute"),
        ("whole frames with 1 % of datagrams lost", f"{percent(whole['udp-fec'], 2)} (FEC)",
         f"{percent(whole['udp-resend'], 0)} with resend; {percent(whole['udp'], 0)} without help", "loss"),
        ("stopped and flooding client, others' p99", f"x {isolation['ratio']:.2f}",
         f"a run against itself: x {isolation['self_ratio']:.2f} +- {isolation['self_spread']:.2f}", "isolation"),
    ]
    lines = ["| figure | emitd | compared with | run |", "|---|---|---|---|"]
    lines += [f"| {what} | {value} | {other} | [{run}] |" for what, value, other, run in rows]
    lines += ["", *wrapped("Embree recomputes the history with one ray per pixel and step; its time is that of the rays "
                           "alone.")]
    lines += ["", *wrapped(
        f"Where emitd is slower: shared memory reaches {shm['iceoryx']:.2f} of iceoryx, which checks nothing, and "
        f"{shm['iceoryx-crc']:.2f} of iceoryx with a checksum.")]
    lines += ["", *wrapped(f"Device: two CPU cores without a GPU, {statue['device']}. The GPU is an "
                           f"{gpu['device']}. The linked runs name date, commit and command.")]
    lines.append("")
    anchors = {"statue": ("renderer", "paper-statue-90"), "gpu": ("renderer", "paper-statue-90-h200"),
               "block": ("renderer", "error-vs-time-block"),
               "scaling": ("renderer", "scaling"), "stream": ("server", "stream"),
               "minute": ("server", "stream-640x512-200hz-60s"), "loss": ("server", "stream-loss"),
               "isolation": ("server", "isolation")}
    lines += [f"[{label}]: {folder}/docs/measured/README.md#{anchor}" for label, (folder, anchor) in anchors.items()]
    return lines


PAGES = {
    "renderer/docs/measured/README.md": lambda page: measured_section("renderer/docs/measured", page),
    "server/docs/measured/README.md": lambda page: measured_section("server/docs/measured", page),
    "README.md": readme_section,
}
BEGIN, END = "<!-- measured:begin -->\n", "<!-- measured:end -->"


def main(arguments):
    if arguments not in ([], ["--check"]):
        print("usage: measured_pages.sh [--check]", file=sys.stderr)
        return 2
    stale = False
    for name, section in PAGES.items():
        path = pathlib.Path(name)
        before = path.read_text()
        begin, end = before.find(BEGIN), before.find(END)
        if begin < 0 or end < begin:
            raise Problem(f"{name}: has no markers {BEGIN.strip()} and {END}")
        text = "\n".join(section(before)).rstrip("\n") + "\n"
        after = before[:begin + len(BEGIN)] + "\n" + text + "\n" + before[end:]
        if after == before:
            continue
        if arguments:
            stale = True
            diff = difflib.unified_diff(before.splitlines(), after.splitlines(), name, "generated", lineterm="", n=0)
            print("\n".join(list(diff)[:20]))
        else:
            path.write_text(after)
            print(f"measured_pages: wrote {name}")
    if stale:
        print("measured_pages: out of date; run deploy/scripts/measured_pages.sh")
        return 1
    print("measured_pages: all pages are up to date")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Problem as problem:
        print(f"measured_pages: {problem}", file=sys.stderr)
        sys.exit(1)
