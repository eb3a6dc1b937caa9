"""How a picture of a tree looks: one style sheet, with sizes that the layout must know too."""

from __future__ import annotations

TITLE, LINE, SLOT, NAME = 13.0, 11.0, 11.0, 12.0
"""Sizes of a node's title and lines, of what stands on a line, of a subtree's name [pixel]."""

STYLE = f"""
.behaviour-tree text {{
  font-family: "Segoe UI", Roboto, "Helvetica Neue", Arial, "DejaVu Sans", sans-serif;
  font-size: {LINE:g}px; fill: #4b5768;
}}
.behaviour-tree .title {{ font-size: {TITLE:g}px; font-weight: 600; fill: #172033; }}
.behaviour-tree .note {{ fill: #172033; }}
.behaviour-tree .slot {{ font-size: {SLOT:g}px; fill: #7d8896; }}
.behaviour-tree .edge {{ fill: none; stroke: #98a2b0; stroke-width: 2; }}
.behaviour-tree .box {{ fill: #f6f7f9; stroke: #9aa5b4; stroke-width: 1.2; }}
.behaviour-tree .skill .box {{ fill: #e6f0ff; stroke: #6f9fe8; }}
.behaviour-tree .use .box {{ stroke-dasharray: 5 4; }}
.behaviour-tree .badge {{ fill: #6b7686; }}
.behaviour-tree .sequence .badge, .behaviour-tree .fallback .badge,
.behaviour-tree .parallel .badge {{ fill: #46566b; }}
.behaviour-tree .retry .badge, .behaviour-tree .repeat .badge, .behaviour-tree .while .badge,
.behaviour-tree .for_each .badge {{ fill: #7350c8; }}
.behaviour-tree .try .badge, .behaviour-tree .timeout .badge, .behaviour-tree .invert .badge,
.behaviour-tree .succeed .badge {{ fill: #0f7c73; }}
.behaviour-tree .symbol {{ font-size: 14px; font-weight: 600; fill: #ffffff; text-anchor: middle; }}
.behaviour-tree .frame {{
  fill: #8b95a3; fill-opacity: 0.1; stroke: #8b95a3; stroke-opacity: 0.7; stroke-dasharray: 5 4;
}}
.behaviour-tree .name {{ font-size: {NAME:g}px; font-weight: 600; fill: #7d8896; }}
.behaviour-tree .running .box {{ fill: #fff0c2; stroke: #d98e04; stroke-width: 2.2; }}
.behaviour-tree .success .box {{ fill: #dcf5e3; stroke: #2f9e55; stroke-width: 2.2; }}
.behaviour-tree .failure .box {{ fill: #fde3e1; stroke: #d1453b; stroke-width: 2.2; }}
.behaviour-tree .running .edge {{ stroke: #d98e04; stroke-width: 2.2; }}
.behaviour-tree .success .edge {{ stroke: #2f9e55; }}
.behaviour-tree .failure .edge {{ stroke: #d1453b; }}
"""
"""Colours of boxes and text hold on any background; lines, frames and what stands on them are between."""
