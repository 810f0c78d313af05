"""USD schema, validators and check_stage."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import eulerfsi_usd
import pytest
from eulerfsi_usd import checks
from eulerfsi_usd.parameters import API_SCHEMAS, load, prim_types, stage_attributes, stage_relationships
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "usd_plugin" / "eulerfsi_usd"


def small_scene() -> Usd.Stage:
    """Valid scene: a domain of 2 x 2 x 2, a tetrahedron, an emitter, a force."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Y")
    domain = UsdGeom.Cube.Define(stage, "/Domain").GetPrim()
    domain.AddAppliedSchema("EulerFsiDomainAPI")
    solid = UsdGeom.Mesh.Define(stage, "/Solid")
    solid.GetPrim().AddAppliedSchema("EulerFsiSolidAPI")
    solid.CreatePointsAttr([(0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), (0, 0, 0.5)])
    solid.CreateFaceVertexCountsAttr([3, 3, 3, 3])
    solid.CreateFaceVertexIndicesAttr([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    solid.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    emitter = UsdGeom.Sphere.Define(stage, "/Emitter").GetPrim()
    emitter.AddAppliedSchema("EulerFsiEmitterAPI")
    UsdGeom.Cube.Define(stage, "/Force").GetPrim().AddAppliedSchema("EulerFsiForceAPI")
    return stage


def author(stage: Usd.Stage, path: str, name: str, value: object) -> None:
    """Authors a value as a careless exporter would: with a type that fits the value."""
    types = {bool: "bool", float: "double", int: "int", str: "token", tuple: "double3", Sdf.AssetPath: "asset"}
    spec = Sdf.CreatePrimInLayer(stage.GetRootLayer(), path)
    attribute = spec.attributes.get(name)
    if attribute is None:
        attribute = Sdf.AttributeSpec(spec, name, Sdf.ValueTypeNames.Find(types[type(value)]))
    attribute.default = Gf.Vec3d(*value) if isinstance(value, tuple) else value


def found(stage: Usd.Stage) -> list[tuple[str, str, str]]:
    return [(issue.code, issue.prim, issue.field) for issue in checks.check_stage(stage)]


# ------------------------------------------------------------------------------------------------------------- schema


@pytest.mark.parametrize("scope", list(API_SCHEMAS))
def test_schema_attributes_equal_the_table(scope: str) -> None:
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(API_SCHEMAS[scope])
    names = {name for name in definition.GetPropertyNames() if name.startswith("eulerfsi:")}
    assert names == {*stage_attributes(scope), *stage_relationships(scope)}
    for name, row in stage_attributes(scope).items():
        attribute = definition.GetAttributeDefinition(name)
        assert attribute.GetTypeName() == Sdf.ValueTypeNames.Find(row.usd_type)
        assert attribute.GetVariability() == (Sdf.VariabilityVarying if row.animated else Sdf.VariabilityUniform)
        fallback = attribute.GetFallbackValue()
        if row.depends_on_stage_units:
            assert fallback == -math.inf
        elif row.type == "vector":
            assert tuple(fallback) == row.default
        elif row.type == "asset":
            assert fallback.path == row.default
        else:
            assert fallback == row.default and type(fallback) is type(row.default)
        assert tuple(attribute.GetMetadata("allowedTokens") or ()) == row.tokens
        assert attribute.GetMetadata("displayName") == row.label
        doc = attribute.GetDocumentation()
        assert doc.startswith(row.doc)
        if row.type in ("double", "vector"):
            assert f"Range: {row.limit_text()}. Unit: " in doc
            hard = (attribute.GetMetadata("limits") or {}).get("hard", {})
            for key, limit in (("minimum", row.hard_min), ("maximum", row.hard_max)):
                expected = None if math.isinf(limit) else Gf.Vec3d(limit) if row.type == "vector" else limit
                assert hard.get(key) == expected


def test_schemas_apply_to_their_prim_types_only() -> None:
    stage = Usd.Stage.CreateInMemory()
    for type_name in ("Cube", "Xform", "Mesh", "Sphere", "Camera"):
        prim = stage.DefinePrim(f"/{type_name}", type_name)
        for scope, schema in API_SCHEMAS.items():
            assert prim.CanApplyAPI(schema) == (type_name in prim_types()[scope])


def test_solid_brings_the_mass_of_usd_physics() -> None:
    stage = small_scene()
    solid = stage.GetPrimAtPath("/Solid")
    assert solid.HasAPI(UsdPhysics.MassAPI)
    assert not solid.HasAttribute("eulerfsi:density") and solid.HasAttribute("physics:density")


def test_plugin_is_found_through_the_environment() -> None:
    program = "from pxr import Usd; print(bool(Usd.SchemaRegistry().FindAppliedAPIPrimDefinition('EulerFsiSolidAPI')))"
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    for path, expected in ((None, "False"), (PACKAGE, "True"), (PACKAGE / "schema", "True")):
        env = environment | ({"PXR_PLUGINPATH_NAME": str(path)} if path else {"PXR_PLUGINPATH_NAME": ""})
        result = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, check=True)
        assert result.stdout.strip() == expected, path


def test_register_can_be_called_again() -> None:
    eulerfsi_usd.register()
    assert Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("EulerFsiDomainAPI")


# ------------------------------------------------------------------------------------------------------------- checks


def test_valid_scene_has_no_issue() -> None:
    assert checks.check_stage(small_scene()) == []


def test_message_names_prim_field_value_and_limit() -> None:
    stage = small_scene()
    author(stage, "/Solid", "eulerfsi:youngsModulus", -5.0)
    (issue,) = checks.check_stage(stage)
    assert issue.message == "/Solid.eulerfsi:youngsModulus = -5: must be > 0"
    parts = (issue.prim, issue.field, issue.value, issue.limit, issue.severity)
    assert parts == ("/Solid", "eulerfsi:youngsModulus", "-5", "> 0", "error")


def test_a_word_where_a_number_belongs_is_quoted_and_told_what_names_stand_for() -> None:
    stage = small_scene()
    author(stage, "/Domain", "eulerfsi:stepTolerance", "0.05")
    (issue,) = checks.check_stage(stage)
    names = "(loose: 0.5, normal: 0.15, fine: 0.05)"
    assert issue.message == f'/Domain.eulerfsi:stepTolerance = "0.05": must be a number {names}'


def test_a_value_of_another_layer_names_its_file(tmp_path) -> None:
    base = small_scene()
    author(base, "/Solid", "eulerfsi:youngsModulus", -5.0)
    base.GetRootLayer().Export(str(tmp_path / "assets.usda"))
    shot = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    shot.GetRootLayer().subLayerPaths.append("assets.usda")
    told = lambda: [issue.message for issue in checks.check_stage(shot) if issue.field == modulus.GetName()]  # noqa: E731
    modulus = shot.GetPrimAtPath("/Solid").GetAttribute("eulerfsi:youngsModulus")
    assert told() == ["/Solid.eulerfsi:youngsModulus = -5: must be > 0 (in assets.usda)"]
    modulus.Set(-4.0)
    assert told() == ["/Solid.eulerfsi:youngsModulus = -4: must be > 0"]


@pytest.mark.parametrize(
    ("path", "name", "value", "code"),
    [
        ("/Domain", "eulerfsi:wallXMin", "slippery", "BadToken"),
        ("/Domain", "eulerfsi:preset", "Production", "BadToken"),
        ("/Domain", "eulerfsi:voxelSize", 0.0, "OutOfRange"),
        ("/Domain", "eulerfsi:voxelSize", math.nan, "OutOfRange"),
        ("/Domain", "eulerfsi:voxelSize", math.inf, "OutOfRange"),
        ("/Domain", "eulerfsi:voxelSize", 2.5, "VoxelTooLarge"),
        ("/Domain", "eulerfsi:voxelSize", "small", "WrongType"),
        ("/Domain", "eulerfsi:cflSolid", -math.inf, "OutOfRange"),
        ("/Domain", "eulerfsi:cflSolid", 1000.1, "OutOfRange"),
        ("/Domain", "eulerfsi:wallYMin", "periodic", "UnpairedPeriodic"),
        ("/Domain", "size", 0.0, "EmptyDomain"),
        ("/Domain", "eulerfsi:voxelsize", 0.1, "UnknownAttribute"),
        ("/Solid", "eulerfsi:voxelSize", 0.1, "UnknownAttribute"),
        ("/Solid", "eulerfsi:density", 10.0, "UnknownAttribute"),
        ("/Solid", "physics:density", 0.0, "OutOfRange"),
        ("/Solid", "physics:density", -2.0, "OutOfRange"),
        ("/Solid", "physics:mass", -1.0, "OutOfRange"),
        ("/Solid", "eulerfsi:poissonsRatio", 0.5, "OutOfRange"),
        ("/Solid", "eulerfsi:velocity", (0.0, math.nan, 0.0), "OutOfRange"),
        ("/Solid", "eulerfsi:velocity", 3.0, "WrongType"),
        ("/Solid", "eulerfsi:enabled", "yes", "WrongType"),
        ("/Solid", "eulerfsi:surfaceFile", Sdf.AssetPath("nowhere.obj"), "MissingFile"),
        ("/Emitter", "eulerfsi:smokeDensity", -1.0, "OutOfRange"),
        ("/Emitter", "radius", 0.0, "EmptyEmitter"),
        ("/Emitter", "eulerfsi:endTime", 0.5, None),
        ("/Force", "eulerfsi:kind", "storm", "BadToken"),
        ("/Force", "eulerfsi:windDrag", -1.0, "OutOfRange"),
        ("/Force", "size", 0.0, "EmptyForce"),
        ("/Solid", "eulerfsi:plasticYieldStress", -1.0, "OutOfRange"),
        ("/Solid", "eulerfsi:plasticFlowRate", 0.0, "OutOfRange"),
    ],
)
def test_bad_value_is_one_issue_at_its_place(path: str, name: str, value: object, code: str | None) -> None:
    stage = small_scene()
    author(stage, path, name, value)
    if code == "UnpairedPeriodic":
        name = name.replace("Min", "Max")  # the face that has to follow
    assert found(stage) == ([(code, path, name)] if code else [])


def test_valid_extremes_are_accepted() -> None:
    stage = small_scene()
    for name in ("wallZMin", "wallZMax"):
        author(stage, "/Domain", f"eulerfsi:{name}", "periodic")
    author(stage, "/Domain", "eulerfsi:cflSolid", 4.0)
    author(stage, "/Domain", "eulerfsi:fluidDensity", -math.inf)
    author(stage, "/Solid", "eulerfsi:poissonsRatio", 0.499)
    author(stage, "/Solid", "physics:density", 0.0)
    author(stage, "/Solid", "physics:mass", 2.0)
    assert found(stage) == []


@pytest.mark.parametrize(
    ("path", "name", "hint"),
    [
        ("/Solid", "eulerfsi:youngModulus", "did you mean eulerfsi:youngsModulus?"),
        ("/Solid", "eulerfsi:density", "use physics:density"),
        ("/Emitter", "eulerfsi:voxelSize", "it belongs to EulerFsiDomainAPI, not applied to this prim"),
    ],
)
def test_unknown_attribute_suggests_the_right_one(path: str, name: str, hint: str) -> None:
    stage = small_scene()
    author(stage, path, name, 1.0)
    (issue,) = checks.check_stage(stage)
    assert issue.code == "UnknownAttribute" and issue.message.endswith(f"({hint})")


def test_misspelled_schema_is_named_with_the_nearest() -> None:
    stage = small_scene()
    stage.DefinePrim("/Other", "Mesh").AddAppliedSchema("EulerFsiSolidsAPI")
    (issue,) = checks.check_stage(stage)
    assert issue.code == "UnknownSchema" and "did you mean EulerFsiSolidAPI?" in issue.message


@pytest.mark.parametrize(("scope", "type_name"), [("domain", "Mesh"), ("solid", "Sphere"), ("emitter", "Camera")])
def test_wrong_prim_type(scope: str, type_name: str) -> None:
    stage = small_scene()
    path = f"/{scope.title()}"
    stage.RemovePrim(path)
    stage.DefinePrim(path, type_name).AddAppliedSchema(API_SCHEMAS[scope])
    issues = [issue for issue in checks.check_stage(stage) if issue.code == "WrongPrimType"]
    assert issues and {(issue.prim, issue.value) for issue in issues} == {(path, type_name)}


def test_number_of_domains() -> None:
    stage = small_scene()
    UsdGeom.Cube.Define(stage, "/Second").GetPrim().AddAppliedSchema("EulerFsiDomainAPI")
    assert found(stage) == [("ManyDomains", "/Second", "apiSchemas")]
    for name in ("/Second", "/Domain"):
        stage.RemovePrim(name)
    assert found(stage) == [("MissingDomain", "/", "domain")]


def test_two_schemas_on_one_prim() -> None:
    stage = small_scene()
    stage.GetPrimAtPath("/Domain").AddAppliedSchema("EulerFsiEmitterAPI")
    assert found(stage) == [("ManySchemas", "/Domain", "apiSchemas")]


def test_units_must_be_authored_and_positive() -> None:
    stage = small_scene()
    stage.GetRootLayer().pseudoRoot.ClearInfo("metersPerUnit")
    # 1 unit is then 0.01 m, in which the default voxel, 0.02 m, is as large as the box.
    assert found(stage) == [("MissingUnits", "/", "metersPerUnit")]
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, -1.0)
    assert found(stage) == [("BadUnits", "/", "kilogramsPerUnit")]


@pytest.mark.parametrize(
    ("attribute", "value", "code", "field"),
    [
        ("points", [(0, 0, 0), (0.5, 0, 0), (0, math.nan, 0), (0, 0, 0.5)], "NonFinitePoints", "points[2]"),
        ("points", [], "MissingMesh", "points"),
        ("faceVertexCounts", [], "MissingMesh", "faceVertexCounts"),
        ("faceVertexCounts", [3, 3, 3, 2], "BadTopology", "faceVertexCounts[3]"),
        ("faceVertexCounts", [3, 3, 3, 4], "BadTopology", "faceVertexIndices"),
        ("faceVertexIndices", [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 4], "BadTopology", "faceVertexIndices[11]"),
        ("points", [(0, 0, 0), (5, 0, 0), (0, 0.5, 0), (0, 0, 0.5)], "OutsideDomain", "points"),
    ],
)
def test_bad_mesh(attribute: str, value: list, code: str, field: str) -> None:
    stage = small_scene()
    stage.GetPrimAtPath("/Solid").GetAttribute(attribute).Set(value)
    assert found(stage) == [(code, "/Solid", field)]


def test_solid_larger_than_a_rotated_domain() -> None:
    stage = small_scene()
    UsdGeom.Xformable(stage.GetPrimAtPath("/Domain")).AddRotateZOp().Set(45.0)
    points = stage.GetPrimAtPath("/Solid").GetAttribute("points")
    points.Set([(0, 0, 0), (1.4, 0, 0), (0, 0.5, 0), (0, 0, 0.5)])  # in the rotated box's corner, 1.414 away
    assert found(stage) == []
    points.Set([(0, 0, 0), (1.1, 1.1, 0), (0, 0.5, 0), (0, 0, 0.5)])  # on its face's axis, 1.556 away
    (issue,) = checks.check_stage(stage)
    assert issue.code == "OutsideDomain" and issue.limit == "inside the domain /Domain, 0 to 2"


def test_sheared_domain() -> None:
    stage = small_scene()
    parent = UsdGeom.Xform.Define(stage, "/Parent")
    parent.AddScaleOp().Set(Gf.Vec3f(1, 2, 1))
    stage.RemovePrim("/Domain")
    domain = UsdGeom.Cube.Define(stage, "/Parent/Domain")
    domain.AddRotateZOp().Set(30.0)
    domain.GetPrim().AddAppliedSchema("EulerFsiDomainAPI")
    assert found(stage) == [("ShearedDomain", "/Parent/Domain", "xformOpOrder")]


def test_xform_as_domain_and_as_solid() -> None:
    stage = small_scene()
    for path in ("/Domain", "/Solid"):
        stage.RemovePrim(path)
    for scope in ("domain", "solid"):
        UsdGeom.Xform.Define(stage, f"/{scope.title()}").GetPrim().AddAppliedSchema(API_SCHEMAS[scope])
    missing = ("MissingMesh", "/Solid", "eulerfsi:surfaceFile")
    assert sorted(found(stage)) == [("EmptyDomain", "/Domain", "eulerfsi:size"), missing]
    author(stage, "/Domain", "eulerfsi:size", (2.0, 2.0, 2.0))
    assert found(stage) == [missing]
    author(stage, "/Solid", "eulerfsi:surfaceFile", Sdf.AssetPath(__file__))
    assert found(stage) == []


def test_density_of_a_physics_material() -> None:
    stage = small_scene()
    material = UsdShade.Material.Define(stage, "/Rubber")
    density = UsdPhysics.MaterialAPI.Apply(material.GetPrim()).CreateDensityAttr(-3.0)
    binding = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/Solid"))
    binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
    assert found(stage) == [("OutOfRange", "/Rubber", "physics:density")]
    density.Set(900.0)
    assert found(stage) == []


def test_disabled_solid_needs_no_mesh() -> None:
    stage = small_scene()
    stage.GetPrimAtPath("/Solid").GetAttribute("points").Set([])
    author(stage, "/Solid", "eulerfsi:enabled", False)
    assert found(stage) == []


def test_warnings() -> None:
    stage = small_scene()
    author(stage, "/Domain", "eulerfsi:ambientFluid", False)
    modulus = stage.GetPrimAtPath("/Solid").CreateAttribute("eulerfsi:youngsModulus", Sdf.ValueTypeNames.Double)
    modulus.Set(1000.0, 1.0)
    modulus.Set(2000.0, 2.0)
    issues = checks.check_stage(stage)
    assert {(issue.code, issue.severity) for issue in issues} == {("NoFluid", "warning"), ("Animated", "warning")}
    for path in ("/Solid", "/Emitter"):
        stage.RemovePrim(path)
    assert found(stage) == [("EmptyScene", "/", "content")]


@pytest.mark.parametrize("scope", list(API_SCHEMAS))
def test_value_fault_accepts_every_default_and_refuses_every_broken_limit(scope: str) -> None:
    for row in load()[scope].values():
        assert checks.value_fault(row, row.default) is None
        if row.type != "double":
            continue
        for limit, beyond in ((row.hard_min, -1.0), (row.hard_max, 1.0)):
            if math.isfinite(limit):
                assert checks.value_fault(row, limit + beyond) == (row.limit_text(), "OutOfRange")
        if row.min_exclusive:
            assert checks.value_fault(row, row.hard_min) is not None
        if row.least:
            assert checks.value_fault(row, 0.0) is None and checks.value_fault(row, row.least) is None
            assert checks.value_fault(row, row.least / 2) == (row.limit_text(), "OutOfRange")


# --------------------------------------------------------------------------------------------------------- validators


def validate(stage: Usd.Stage) -> set[tuple[str, str]]:
    """(error name, site) of our validators."""
    validation = pytest.importorskip("pxr.UsdValidation")
    registry = validation.ValidationRegistry()
    names = [f"eulerfsi_usd.validators:{name}Checker" for name in ("Scene", "Domain", "Solid", "Emitter", "Force")]
    validators = registry.GetOrLoadValidatorsByName(names)
    if len(validators) < 5:
        pytest.skip("this USD has no validators in Python")
    errors = validation.ValidationContext(validators).Validate(stage)
    sites = [(error, error.GetSites()[0]) for error in errors]
    return {
        (e.GetName(), str(s.GetProperty().GetPath() if s.IsProperty() else s.GetPrim().GetPath())) for e, s in sites
    }


def test_validators_report_the_issues_of_check_stage() -> None:
    assert validate(small_scene()) == set()
    stage = small_scene()
    author(stage, "/Domain", "eulerfsi:wallXMin", "slippery")
    author(stage, "/Solid", "eulerfsi:youngsModulus", -5.0)
    author(stage, "/Emitter", "eulerfsi:smokeDensity", -1.0)
    author(stage, "/Solid", "eulerfsi:dampening", 1.0)
    UsdGeom.Cube.Define(stage, "/Second").GetPrim().AddAppliedSchema("EulerFsiDomainAPI")
    assert validate(stage) == {
        ("BadToken", "/Domain.eulerfsi:wallXMin"),
        ("OutOfRange", "/Solid.eulerfsi:youngsModulus"),
        ("OutOfRange", "/Emitter.eulerfsi:smokeDensity"),
        ("UnknownAttribute", "/Solid.eulerfsi:dampening"),
        ("ManyDomains", "/Second"),
    }


def test_validators_leave_other_stages_alone() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/Mesh", "Mesh")
    assert validate(stage) == set()
