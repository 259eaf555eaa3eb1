"""Merging comparisons of several splits or seeds into one."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pgm_places.evaluation.evaluation import Evaluation
from pgm_places.experiment.comparison import Comparison, MethodResult, SeedResult, score_intervals
from pgm_places.experiment.experiment import Experiment


def over_splits(experiment: Experiment, parts: Mapping[str, Comparison], words: str) -> Comparison:
    """Merge the comparisons of all splits, with the test items of all.

    Parameters
    ----------
    experiment : Experiment
        Receives the warnings of all parts.
    parts : mapping of str to Comparison
        Comparisons by name of the split.
    words : str
        Appended to the title.
    """
    every = list(parts.values())
    first, maps = every[0], tuple(result for part in every for result in part.maps)
    ends = np.cumsum([0, *(len(part.maps) for part in every)]).tolist()
    methods = []
    for results in zip(*(part.methods for part in every), strict=True):
        merged = _concatenated(results)
        intervals = score_intervals(maps, [merged.labelings], len(first.label_names))
        choices = _choices(dict(zip(parts, [result.choices for result in results], strict=True)))
        methods.append(replace(merged, intervals=intervals, choices=choices))
    return replace(
        _noted(experiment, every),
        title=f"{first.title}: {words}",
        maps=maps,
        methods=tuple(methods),
        splits={name: range(*ends[k : k + 2]) for k, name in enumerate(parts)},
        selection=None,
        gates=tuple(scores for part in every for scores in part.gates),
        choices=_choices({name: part.choices for name, part in parts.items()}),
    )


def over_seeds(experiment: Experiment, parts: Mapping[int, Comparison]) -> Comparison:
    """Merge the comparisons of the same data with several seeds.

    Figures are over all seeds. Labellings, histories, doors and learned values are of the first
    seed; ``by_seed`` of each method has the labellings of all seeds.
    """
    every, methods = list(parts.values()), []
    first = every[0]
    for results in zip(*(part.methods for part in every), strict=True):
        pooled = _pooled(dict(zip(parts, results, strict=True)))
        labelings = [result.labelings for result in results]
        intervals = score_intervals(first.maps, labelings, len(first.label_names))
        choices = _choices(
            {f"seed {seed}": result.choices for seed, result in zip(parts, results, strict=True)}
        )
        methods.append(replace(pooled, intervals=intervals, choices=choices))
    if all(_is_independent_of_seed(method) for method in methods):
        experiment.warn(
            f"the labels of all methods are equal for all {len(parts)} seeds, because their "
            "training is not random; compare on several splits instead"
        )
    return replace(
        _noted(experiment, every),
        title=f"{first.title}, {len(parts)} seeds",
        methods=tuple(methods),
        selection=None,
        choices=_choices({f"seed {seed}": part.choices for seed, part in parts.items()}),
    )


def _choices(parts: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """The choices of all parts: once if they agree, else with the name of each part."""
    chosen: dict[str, str] = {}
    for option in dict.fromkeys(option for choices in parts.values() for option in choices):
        words = {name: choices[option] for name, choices in parts.items() if option in choices}
        if len(words) == len(parts) and len({*words.values()}) == 1:
            chosen[option] = next(iter(words.values()))
        else:
            chosen |= {f"{option} ({name})": text for name, text in words.items()}
    return chosen


def _noted(experiment: Experiment, parts: Sequence[Comparison]) -> Comparison:
    """The first part with the seconds, inputs and warnings of all."""
    seconds: dict[str, float] = {}
    inputs = dict(experiment.inputs)
    for part in parts:
        inputs |= part.inputs
        for name, value in part.stage_seconds.items():
            seconds[name] = seconds.get(name, 0.0) + value
        for message in part.warnings:
            experiment.warn(message)
    notes = tuple(experiment.warnings)
    return replace(parts[0], stage_seconds=seconds, inputs=inputs, warnings=notes)


def _concatenated(results: Sequence[MethodResult]) -> MethodResult:
    """The results of one method on all splits, without learned values, which differ."""
    return replace(
        results[0],
        labelings=tuple(item for result in results for item in result.labelings),
        evaluations=tuple(item for result in results for item in result.evaluations),
        evaluation=Evaluation.merged([result.evaluation for result in results]),
        seconds={key: sum(result.seconds[key] for result in results) for key in ("learn", "infer")},
        learned={},
        histories=tuple(item for result in results for item in result.histories),
        learning={},
        doors=tuple(item for result in results for item in result.doors),
    )


def _pooled(results: Mapping[int, MethodResult]) -> MethodResult:
    """The results of one method with all seeds; seconds are means over seeds."""
    every = list(results.values())
    by_map = zip(*(result.evaluations for result in every), strict=True)
    return replace(
        every[0],
        evaluations=tuple(Evaluation.merged(list(of_seeds)) for of_seeds in by_map),
        evaluation=Evaluation.merged([result.evaluation for result in every]),
        seconds={
            key: float(np.mean([result.seconds[key] for result in every]))
            for key in ("learn", "infer")
        },
        by_seed={
            seed: SeedResult(result.labelings, result.evaluation)
            for seed, result in results.items()
        },
    )


def _is_independent_of_seed(method: MethodResult) -> bool:
    first, *others = (result.labelings for result in method.by_seed.values())
    return all(
        np.array_equal(one.labels, two.labels)
        for other in others
        for one, two in zip(first, other, strict=True)
    )
