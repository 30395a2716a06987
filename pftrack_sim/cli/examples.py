"""Examples at the end of each help page. Run in this order, in one folder, they all work."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "": ("list scenarios", "bench plaza-walk --trackers ko2012,stay --seeds 0:6 --out runs/first", "report runs/first"),
    "list": ("list scenarios", "list trackers", "list axes"),
    "new": ("new my-own.toml", "new another.toml"),
    "map": ("map my-own.toml --seed 3 --out map.svg", "map hall --set target.path=auto --out map.png"),
    "render": (
        "render street-night --seed 3 --video night.mp4 --truth",
        "render plaza-walk --trackers ko2012,ncc --param ko2012.particles=true --video look.mp4",
        "render warehouse --image frame.png --at-s 1 --set camera.width_px=320 --set camera.height_px=240",
    ),
    "studio": ("studio corridor --trackers ko2012,pftrack", "studio follow/plaza --robot hand --port 9000"),
    "profile": ("profile plaza-walk --seeds 0:2", "profile corridor --axis jitter=0,1,2 --seeds 0:1 --out profiles"),
    "bench": (
        "bench plaza-walk --trackers ko2012,stay --seeds 0:6 --out runs/first",
        "bench corridor --trackers ko2012 --param ko2012.alpha=0.3 --axis jitter=0,1 --seeds 0 --cache --out runs/axis",
        "bench plaza-walk --trackers ncc --seeds 0:8 --videos worst:2 --out runs/first",
    ),
    "follow": (
        "follow follow/plaza --trackers oracle,ko2012 --seeds 0:2 --out runs/driven",
        "follow corridor --trackers ncc --controllers servo --latency measured --seeds 0:2 --out runs/late",
    ),
    "limit": (
        "limit corridor --axis jitter --axis noise --trackers ncc,deguchi2004 --budget 24 --out runs/limit",
        "limit follow/plaza --axis jitter=0.5:8 --follow --trackers ncc --budget 24 --no-videos --out runs/drive",
    ),
    "film": ("film runs/first --worst 2 --tracker ko2012", "film runs/driven --worst 1"),
    "export": (
        "export corridor --format vot --seeds 0:4 --out dataset",
        "export plaza-walk --format coco --with depth,masks --image jpg --seeds 0:1 --out training",
    ),
    "measure": (
        "measure look.mp4 --fovy-deg 50 --out my_robot.toml",
        "measure dataset/sequences/corridor-0000 --fovy-deg 50",
    ),
    "evaluate": (
        "evaluate dataset --trackers ko2012,ncc --seeds 0:2",
        "evaluate dataset/sequences/corridor-0000 --trackers ncc --seeds 0 --video boxes.mp4",
    ),
    "merge": (
        "bench corridor --trackers ncc --seeds 0:4 --part 1/2 --out runs/part1",
        "bench corridor --trackers ncc --seeds 0:4 --part 2/2 --out runs/part2",
        "merge runs/v1 runs/part1 runs/part2",
    ),
    "export-results": (
        "export-results runs/v1 --format vot --out results",
        "export-results runs/first --format got10k --out got10k",
    ),
    "score": (
        "score results --dataset dataset",
        "score results --dataset dataset --results-format vot --out scored",
    ),
    "compare": (
        "compare runs/first --trackers stay,ko2012",
        "compare runs/v1 runs/v2",
        "compare runs/v1 runs/v2 --measure success --html difference.html",
    ),
    "report": ("report runs/first", "report runs/first --figure success.pdf"),
    "submit": ("submit runs/mine runs/mine-driven --out mine.parquet", "submit mine.parquet --verify"),
    "query": (
        'query runs/first "SELECT tracker, avg(mean_overlap) FROM summary GROUP BY tracker"',
        'query runs/first "FROM losses" --format csv',
        'query runs/first "SELECT person, count(*), min(distance_m) FROM people GROUP BY person"',
    ),
    "check": ("check runs/first", "check runs/driven"),
    "tables": ("tables results.md --runs runs", "tables results.md"),
    "trax": ("trax ko2012", "trax ko2012[particle_count=200] --seed 3"),
    "schema": ("schema scenario.schema.json", "schema"),
    "doctor": ("doctor", "doctor --check"),
}
"""Command lines, without the program's name, by the command whose help shows them; `""` is the program itself."""


def epilog(command: str) -> str:
    """The examples as the end of a help page; they are not wrapped."""
    return "\b\nExamples:\n" + "\n".join(f"  pftrack-sim {one}" for one in EXAMPLES[command])
