// Purpose: views of the fields, setting them, diagnostics that agree with them.
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "unit/capi/scene.hpp"

using namespace efsi::test;

TEST_CASE("The view of the pressure holds the pressure under the weight of smoke, less that of the fluid itself") {
  EfsiSimulationDef def = box();
  def.fluid_density = 1000.0;
  def.domain_min = {-1.0, 2.0, 0.5};
  def.domain_size = {0.3, 0.4, 0.5};  // 6 x 8 x 10 cells
  def.pressure_tolerance = 1e-7;
  def.smoke_buoyancy = 2.0;
  const Sim sim = create(def);
  const std::vector<float> smoke(6 * 8 * 10, 1.0f);
  REQUIRE(efsi_field_set(sim.get(), EFSI_FIELD_SMOKE_DENSITY, 0, smoke.data(), smoke.size()) == EFSI_OK);
  REQUIRE(efsi_simulation_step(sim.get(), 0.01, nullptr, 0) == EFSI_OK);
  const EfsiFieldView p = view_of(sim, EFSI_FIELD_PRESSURE);
  CHECK(p.components == 1);
  CHECK(p.cell_centered == 1);
  CHECK(p.stride[0] == 1);
  CHECK(p.spacing == 0.05);
  CHECK(p.origin.x == Approx(-0.975));
  CHECK(p.origin.y == Approx(2.025));
  CHECK(p.origin.z == Approx(0.525));
  REQUIRE(p.size[0] == 6);
  REQUIRE(p.size[1] == 8);
  REQUIRE(p.size[2] == 10);
  double worst = 0.0;
  for_each_element(p, [&](int, int i, int j, int k) {
    const double expected = 1000.0 * 2.0 * 0.05 * (7 - j);  // above the top layer of cells
    worst = std::max(worst, std::abs(value(p, 0, i, j, k) - value(p, 0, 0, 7, 0) - expected));
  });
  CHECK(worst < 0.01 * 1000.0 * 2.0 * 0.05);
}

TEST_CASE("Fields that were set are seen in the views") {
  const Sim sim = scene();
  for (const auto& [field, solid] : std::vector<std::pair<int32_t, uint32_t>>{{EFSI_FIELD_VELOCITY, 0},
                                                                              {EFSI_FIELD_SMOKE_DENSITY, 0},
                                                                              {EFSI_FIELD_SOLID_DISPLACEMENT, 1},
                                                                              {EFSI_FIELD_SOLID_VELOCITY, 1}}) {
    EfsiFieldView view = view_of(sim, field, solid);
    CHECK(view.components == (field == EFSI_FIELD_SMOKE_DENSITY ? 1 : 3));
    CHECK(view.cell_centered == (field == EFSI_FIELD_SMOKE_DENSITY ? 1 : 0));
    std::vector<float> values(count_of(view));
    REQUIRE(values.size() > 1000);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = 1e-6f * static_cast<float>(i);
    EfsiSim* s = sim.get();
    CHECK(efsi_field_set(s, field, solid, values.data(), values.size() - 1) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains("count = " + std::to_string(values.size() - 1)) &&
                                    Contains("must be " + std::to_string(values.size())));
    values[17] = std::numeric_limits<float>::quiet_NaN();
    CHECK(efsi_field_set(s, field, solid, values.data(), values.size()) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains("values[17] = nan"));
    values[17] = 17e-6f;
    REQUIRE(efsi_field_set(s, field, solid, values.data(), values.size()) == EFSI_OK);
    view = view_of(sim, field, solid);
    std::size_t next = 0, wrong = 0;
    for_each_element(view, [&](int c, int i, int j, int k) { wrong += value(view, c, i, j, k) != values[next++]; });
    CHECK(wrong == 0);
  }
  float one = 0.0f;
  for (int32_t field : {EFSI_FIELD_PRESSURE, EFSI_FIELD_SOLID_FRACTION}) {
    CHECK(efsi_field_set(sim.get(), field, 0, &one, 1) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains("cannot be set"));
  }
}

TEST_CASE("A field that the scene does not use has size 0 until it is set") {
  const Sim sim = create(box());
  for (int32_t field : {EFSI_FIELD_SMOKE_DENSITY, EFSI_FIELD_SMOKE_TEMPERATURE, EFSI_FIELD_SOLID_FRACTION}) {
    const EfsiFieldView view = view_of(sim, field);
    CHECK(count_of(view) == 0);
    CHECK(view.data[0] == nullptr);
    CHECK(view.components == 1);
  }
  const std::vector<float> warm(12 * 12 * 12, 20.0f);
  REQUIRE(efsi_field_set(sim.get(), EFSI_FIELD_SMOKE_TEMPERATURE, 0, warm.data(), warm.size()) == EFSI_OK);
  CHECK(count_of(view_of(sim, EFSI_FIELD_SMOKE_TEMPERATURE)) == warm.size());

  EfsiSimulationDef def = box();
  def.ambient_fluid = 0;
  const Sim vacuum = create(def);
  CHECK(efsi_field_set(vacuum.get(), EFSI_FIELD_SMOKE_DENSITY, 0, warm.data(), warm.size()) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(vacuum), Contains("ambient_fluid"));
}

TEST_CASE("Without ambient fluid the fields of the box are seen whole, and a velocity of the fluid is refused") {
  EfsiSimulationDef def = box();
  def.ambient_fluid = 0;
  def.gravity = {0.0, -100.0, 0.0};
  const Sim sim = create(def);
  const EfsiSolidDef solid = cube_def();
  REQUIRE(efsi_solid_add(sim.get(), &solid, nullptr) == EFSI_OK);
  for (int n = 0; n < 10; ++n) REQUIRE(efsi_simulation_step(sim.get(), 0.02, nullptr, 0) == EFSI_OK);  // onto the floor
  for (int32_t field : {EFSI_FIELD_VELOCITY, EFSI_FIELD_PRESSURE, EFSI_FIELD_SOLID_FRACTION}) {
    const EfsiFieldView view = view_of(sim, field);
    for (int a = 0; a < 3; ++a) CHECK(view.size[a] == (field == EFSI_FIELD_VELOCITY ? 13 : 12));
    double largest = 0.0;
    for (int c = 0; c < view.components; ++c)
      for (int k = 0; k < view.size[2]; ++k)
        for (int j = 0; j < view.size[1]; ++j)
          for (int i = 0; i < view.size[0]; ++i)
            largest = std::max(largest, static_cast<double>(std::abs(value(view, c, i, j, k))));
    INFO("field " << field);
    CHECK((largest > 0.0) == (field != EFSI_FIELD_VELOCITY));
  }
  const std::vector<float> still(3 * 13 * 13 * 13, 0.0f);
  CHECK(efsi_field_set(sim.get(), EFSI_FIELD_VELOCITY, 0, still.data(), still.size()) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("field = 0") && Contains("EfsiSimulationDef.ambient_fluid = 1"));
}

TEST_CASE("Diagnostics agree with each other and with the fields") {
  const Sim sim = scene();
  const EfsiFieldView fraction = view_of(sim, EFSI_FIELD_SOLID_FRACTION);
  double volume = 0.0;
  for_each_element(fraction,
                   [&](int, int i, int j, int k) { volume += 0.05 * 0.05 * 0.05 * value(fraction, 0, i, j, k); });
  EfsiSolidDiagnostics solid;
  EfsiFluidDiagnostics fluid;
  REQUIRE(efsi_solid_get_diagnostics(sim.get(), 1, &solid, sizeof(solid)) == EFSI_OK);
  REQUIRE(efsi_simulation_get_fluid_diagnostics(sim.get(), &fluid, sizeof(fluid)) == EFSI_OK);
  CHECK(volume == Approx(solid.volume_cells).epsilon(1e-5));
  CHECK(volume == Approx(0.008).epsilon(0.05));
  CHECK(solid.mass == Approx(1000.0 * solid.rest_volume).epsilon(1e-6));
  CHECK(solid.center.x == Approx(0.3).margin(1e-3));
  CHECK(solid.center.y == Approx(0.35).margin(1e-3));
  CHECK(solid.kinetic_energy == 0.0);
  CHECK(solid.extent_min.y == Approx(0.25));
  CHECK(solid.elements > 0);
  CHECK(solid.memory_bytes > 0);
  CHECK(fluid.smoke == Approx(0.6 * 0.1 * 0.6).epsilon(1e-5));
  CHECK(fluid.kinetic_energy == 0.0);
}

TEST_CASE("What is added after a look at the fields is part of the first frame") {
  const Sim sim = create(box()), other = create(box());
  const EfsiSolidDef solid = cube_def();
  EfsiEmitterDef smoke = carpet_def();
  smoke.transform[5] = 1.2;  // the whole box
  REQUIRE(count_of(view_of(sim, EFSI_FIELD_SMOKE_DENSITY)) == 0);
  REQUIRE(efsi_emitter_add(sim.get(), &smoke, nullptr) == EFSI_OK);
  REQUIRE(value(view_of(sim, EFSI_FIELD_SMOKE_DENSITY), 0, 6, 6, 6) == 1.0f);
  REQUIRE(efsi_solid_add(sim.get(), &solid, nullptr) == EFSI_OK);
  const EfsiFieldView view = view_of(sim, EFSI_FIELD_SMOKE_DENSITY);
  CHECK(value(view, 0, 6, 6, 6) == 0.0f);
  CHECK(value(view, 0, 6, 1, 6) == 1.0f);

  REQUIRE(efsi_solid_add(other.get(), &solid, nullptr) == EFSI_OK);
  REQUIRE(efsi_emitter_add(other.get(), &smoke, nullptr) == EFSI_OK);
  CHECK(hash_of(sim) == hash_of(other));
}
