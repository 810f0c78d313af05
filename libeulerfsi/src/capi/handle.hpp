// Purpose: the content of the opaque types of the C API.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "eulerfsi/eulerfsi.h"
#include "io/mesh_reader.hpp"
#include "io/vdb_io.hpp"
#include "sim/simulation.hpp"

struct EfsiSim {
  EfsiSim(const efsi::sim::Params& params, efsi::Log log) : simulation(params, std::move(log)) {}
  efsi::sim::Simulation simulation;
  std::vector<efsi::geometry::MeshReport> reports;  // of the meshes of solids and colliders
  mutable std::string last_error;                   // of the last failed call, also of those that only read
};

struct EfsiSurface {
  std::shared_ptr<const efsi::geometry::Surface> surface;
};

struct EfsiMesh {
  efsi::io::PolygonMesh polygons;
};

struct EfsiVdb {
  efsi::io::VdbFile file;
};
