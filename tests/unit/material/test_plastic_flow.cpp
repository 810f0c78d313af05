// Purpose: plastic flow at a point against closed forms: yield, hardening, rate, load and unload.
#include <catch2/catch.hpp>
#include <cmath>

#include "material/plastic_flow.hpp"

using namespace efsi;
using namespace efsi::material;

namespace {

constexpr double kFast = 1e9;

// A bar that is pulled or pressed along x at constant volume.
Vec3d pulled(double along) { return {along, 1.0 / std::sqrt(along), 1.0 / std::sqrt(along)}; }

// Its Cauchy stress along x, with the sides free, in closed form: no bulk modulus has a part in it.
double bar_stress(Law law, double mu, double s) {
  const double across = 1.0 / std::sqrt(s);
  if (law == Law::kCorotational) return 2.0 * mu * (s * s - s - across * across + across);
  if (law == Law::kStVenantKirchhoff) return mu * (s * s * (s * s - 1.0) - across * across * (across * across - 1.0));
  REQUIRE(law == Law::kStableNeoHookean);
  const double m = 4.0 / 3.0 * mu, squares = s * s + 2.0 / s;
  return m * (1.0 - 1.0 / (squares + 1.0)) * (s * s - 1.0 / s);
}

// lambda = 0
Elastic elastic_of(Law law) { return from_youngs_modulus(law, 2e4, 0.0); }

template <class Function>
double root(const Function& function, double low, double high) {
  for (int it = 0; it < 100; ++it) (function(0.5 * (low + high)) > 0.0 ? high : low) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

// The bar as its total stretch goes through a path: elastic stretch and accumulated strain.
struct Bar {
  Elastic elastic;
  Plastic plastic;
  double stretch = 1.0, yielded = 1.0, accumulated = 0.0;  // elastic and plastic stretch
  void go_to(double total, double dt) {
    const Flow flow = plastic_flow(elastic, plastic, pulled(total / yielded), accumulated, dt);
    stretch = std::exp(flow.strain[0]);
    yielded = total / stretch;
    accumulated += flow.accumulated;
  }
};

}  // namespace

TEST_CASE("The equivalent stress of a pulled bar is its stress", "[law]") {
  for (const Law law : kLaws)
    for (const double s : {0.7, 0.95, 1.1, 1.6}) {
      const Elastic elastic = elastic_of(law);
      CHECK(equivalent_stress(elastic, pulled(s)) == Approx(std::abs(bar_stress(law, elastic.mu, s))).epsilon(1e-9));
    }
}

TEST_CASE("A bar that is loaded and unloaded: closed form", "[law]") {
  const double hardening = GENERATE(0.0, 3000.0);
  for (const Law law : kLaws)
    for (const int steps : {1, 200})
      for (const double most : {0.7, 1.5}) {
        Bar bar{elastic_of(law), {2000.0, kFast, hardening}};
        for (int n = 1; n <= steps; ++n) bar.go_to(1.0 + (most - 1.0) * n / steps, 1e-3);
        // |bar_stress(s)| = yield stress + H |log(most / s)|
        const double mu = bar.elastic.mu, sign = most > 1.0 ? 1.0 : -1.0;
        const auto above = [&](double strain) {
          return sign * bar_stress(law, mu, std::exp(sign * strain)) - 2000.0 -
                 hardening * (std::abs(std::log(most)) - strain);
        };
        const double strain = root(above, 0.0, 0.3), expected = std::exp(sign * strain);
        CHECK(bar.stretch == Approx(expected).epsilon(1e-3 * strain));
        CHECK(bar.accumulated == Approx(std::abs(std::log(most)) - strain).epsilon(1e-3));
        // Unloading is elastic: without stress the bar keeps this stretch.
        const double kept = bar.yielded;
        bar.go_to(kept, 1e-3);
        CHECK(bar.stretch == Approx(1.0).epsilon(1e-12));
        CHECK(std::log(bar.yielded) == Approx(std::log(most) - sign * strain).epsilon(1e-3));
      }
}

TEST_CASE("Flow keeps the volume and the mean strain, and dissipates") {
  const Plastic plastic{500.0, 40.0, 800.0};
  for (const Law law : kLaws) {
    const Elastic elastic = from_youngs_modulus(law, 2e4, 0.3);
    for (const Vec3d& s : {Vec3d(1.4, 0.9, 0.85), Vec3d(0.6, 1.3, 1.1), Vec3d(0.9, 0.7, 2.0)}) {
      const Flow flow = plastic_flow(elastic, plastic, s, 0.1, 0.01);
      CHECK(flow.accumulated > 0.0);
      CHECK(flow.strain.sum() == Approx(std::log(s.prod())).margin(1e-12));
      const Vec3d after = flow.strain.array().exp().matrix();
      CHECK(principal_response(elastic, after).energy < principal_response(elastic, s).energy);
      CHECK(equivalent_stress(elastic, after) < equivalent_stress(elastic, s));
    }
  }
}

TEST_CASE("Nothing flows below the yield stress") {
  const Elastic elastic = elastic_of(Law::kCorotational);
  const double at = equivalent_stress(elastic, pulled(1.1));
  CHECK(plastic_flow(elastic, {1.001 * at, kFast, 0.0}, pulled(1.1), 0.0, 1.0).accumulated == 0.0);
  CHECK(plastic_flow(elastic, {0.999 * at, kFast, 0.0}, pulled(1.1), 0.0, 1.0).accumulated > 0.0);
  // What has hardened does not flow either, and volume alone never yields.
  CHECK(plastic_flow(elastic, {0.5 * at, kFast, 1e4}, pulled(1.1), at / 1e4, 1.0).accumulated == 0.0);
  CHECK(plastic_flow(elastic, {1.0, kFast, 0.0}, Vec3d::Constant(1.3), 0.0, 1.0).accumulated == 0.0);
}

TEST_CASE("Stress above the yield stress relaxes at the flow rate, whatever the steps") {
  const double rate = 30.0, time = 0.05;
  const Elastic elastic = elastic_of(Law::kCorotational);
  const auto strain_after = [&](int steps) {
    Bar bar{elastic, {1000.0, rate, 2000.0}};
    for (int n = 0; n < steps; ++n) bar.go_to(1.2, time / steps);
    return bar.accumulated;
  };
  Bar fast{elastic, {1000.0, kFast, 2000.0}};
  fast.go_to(1.2, time);
  const double expected = fast.accumulated * (1.0 - std::exp(-rate * time));
  for (const int steps : {1, 2, 50}) CHECK(strain_after(steps) == Approx(expected).epsilon(1e-6));
}
