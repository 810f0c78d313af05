"""The checks of eulerfsi_usd.checks as validators of UsdValidation.

USD imports this module when it loads the plug-in `eulerfsi_usd.validators`. Python validators need a USD whose
UsdValidation offers them; elsewhere the import does nothing and `eulerfsi_usd.checks` still works.
"""

from __future__ import annotations

from pxr import Usd

from .. import checks

try:
    from pxr import UsdValidation

    _registry = UsdValidation.ValidationRegistry()
    SUPPORTED = hasattr(_registry, "RegisterPluginPrimValidator")
except ImportError:
    SUPPORTED = False

PLUGIN = "eulerfsi_usd.validators"


def _errors(stage: Usd.Stage, issues: list[checks.Issue]) -> list:
    """Validation errors that point at the attribute where there is one, at the prim or the stage otherwise."""
    types = {"error": UsdValidation.ValidationErrorType.Error, "warning": UsdValidation.ValidationErrorType.Warn}
    errors = []
    for issue in issues:
        name = issue.field.partition("[")[0]  # an element of an array: points[7]
        exists = issue.prim != "/" and stage.GetPrimAtPath(issue.prim).HasProperty(name)
        site = UsdValidation.ValidationErrorSite(stage, f"{issue.prim}.{name}" if exists else issue.prim)
        errors.append(UsdValidation.ValidationError(issue.code, types[issue.severity], [site], issue.message))
    return errors


def _prim_validator(check):
    def validate(prim: Usd.Prim, _time_range) -> list:
        return _errors(prim.GetStage(), check(prim))

    return validate


def _scene_validator(stage: Usd.Stage, _time_range) -> list:
    # A stage that has nothing to do with eulerfsi needs no domain.
    return _errors(stage, checks.check_scene(stage)) if checks.uses_eulerfsi(stage) else []


if SUPPORTED:
    _registry.RegisterPluginStageValidator(f"{PLUGIN}:SceneChecker", _scene_validator)
    _registry.RegisterPluginPrimValidator(f"{PLUGIN}:DomainChecker", _prim_validator(checks.check_domain))
    _registry.RegisterPluginPrimValidator(f"{PLUGIN}:SolidChecker", _prim_validator(checks.check_solid))
    _registry.RegisterPluginPrimValidator(f"{PLUGIN}:EmitterChecker", _prim_validator(checks.check_emitter))
    _registry.RegisterPluginPrimValidator(f"{PLUGIN}:ForceChecker", _prim_validator(checks.check_force))
    _registry.RegisterPluginPrimValidator(f"{PLUGIN}:ColliderChecker", _prim_validator(checks.check_collider))
