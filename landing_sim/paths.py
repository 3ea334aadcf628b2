"""Where aircraft and scenarios lie: in a checkout beside the package, in an installed wheel inside it."""

from __future__ import annotations

from pathlib import Path

from landing_sim.errors import ConfigError, Mark, Problem, did_you_mean

_PACKAGE = Path(__file__).resolve().parent


def data_folder(name: str) -> Path:
    """The folder `aircraft` or `scenarios`. Raises FileNotFoundError if the installation lacks it."""
    for parent in (_PACKAGE.parent, _PACKAGE / "data"):
        folder = parent / name
        # A folder of that name beside an installed package is somebody else's.
        if folder.is_dir() and (parent != _PACKAGE.parent or (parent / "pyproject.toml").is_file()):
            return folder
    raise FileNotFoundError(f"this installation of landing-sim has no {name}/ folder: install it again")


def aircraft_names() -> tuple[str, ...]:
    """Vehicles that can be flown: folders of aircraft/ with a vehicle.yaml."""
    return tuple(sorted(p.parent.name for p in data_folder("aircraft").glob("*/vehicle.yaml")))


def aircraft_folder(name: str) -> Path:
    """The folder of one vehicle. Raises ConfigError naming the nearest if there is none."""
    names = aircraft_names()
    if name not in names:
        near = did_you_mean(name, names) or f"; there are: {', '.join(names)}"
        raise ConfigError([Problem(Mark(name), (), f"no such aircraft{near}")])
    return data_folder("aircraft") / name


def scenario_names() -> tuple[str, ...]:
    """Shipped scenarios, as ``do128/gust``."""
    return tuple(name for name in _yaml_names() if not _is_campaign(name))


def campaign_names() -> tuple[str, ...]:
    """Shipped campaigns, as ``do128/campaign_wind``."""
    return tuple(name for name in _yaml_names() if _is_campaign(name))


def _yaml_names() -> tuple[str, ...]:
    folder = data_folder("scenarios")
    return tuple(sorted(p.relative_to(folder).with_suffix("").as_posix() for p in folder.glob("*/*.yaml")))


def _is_campaign(name: str) -> bool:
    return name.rpartition("/")[2].startswith("campaign")


def scenario_file(name: str) -> Path:
    """A shipped scenario's file by its name, else the path as given. Raises ConfigError if there is neither."""
    return _file(name, scenario_names(), "scenario")


def campaign_file(name: str) -> Path:
    """A shipped campaign's file by its name, else the path as given. Raises ConfigError if there is neither."""
    return _file(name, campaign_names(), "campaign")


def _file(name: str, names: tuple[str, ...], kind: str) -> Path:
    if name in names:
        return data_folder("scenarios") / f"{name}.yaml"
    path = Path(name)
    try:
        if path.exists():
            return path
    except (OSError, ValueError):  # too long, or a NUL inside: certainly no file
        pass
    near = did_you_mean(name, names) or did_you_mean(f"do128/{name}", names)
    raise ConfigError([Problem(Mark(name), (), f"no such file or shipped {kind}{near}; `landing-sim list` shows them")])
