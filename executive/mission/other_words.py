"""Words of mission and cell files that were renamed, or that other languages use."""

WORD_BY_OTHER_WORD = {
    "aim": "max_position_std",
    "and": "all",
    "confused": "confusion_rate",
    "else": "try",
    "for": "for_each",
    "if": "try",
    "invented": "false_detections",
    "least_force": "min_force",
    "loop": "repeat",
    "misjudged": "max_class_error",
    "misses": "miss_rate",
    "most": "max",
    "or": "any",
    "overlooked": "max_miss_probability",
    "planning": "planning_time",
    "selector": "fallback",
}
"""Word of the current language by a former or foreign word; findings about unknown words state it."""
