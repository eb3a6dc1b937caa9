"""Renamed keys of mission and cell files."""

NEW_KEY_BY_FORMER_KEY = {
    "aim": "max_position_std",
    "confused": "confusion_rate",
    "invented": "false_detections",
    "least_force": "min_force",
    "misjudged": "max_class_error",
    "misses": "miss_rate",
    "most": "max",
    "overlooked": "max_miss_probability",
    "planning": "planning_time",
}
"""New name of a key by its former name; a finding about the former name states the new name."""
