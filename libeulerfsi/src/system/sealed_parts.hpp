// Purpose: parts of the cells with a pressure that nothing opens: a closed box, and pockets that what moves as given
// shuts off. A constant pressure in such a part moves nothing, so that no pressure can take what flows into it: that is
// spread over its cells.
#pragma once

#include <vector>

#include "linalg/pcg.hpp"
#include "system/divergence.hpp"

namespace efsi::system {

class SealedParts {
 public:
  // moves: per node, whether a pressure can move anything there. apply: A of the level, on padded cells.
  void find(const Parallel& parallel, const PressureLevel& level, const std::vector<std::uint8_t>& moves,
            const linalg::Operator& apply);
  // Takes from each of these parts of r its mean; padded cells.
  void subtract_means(const Parallel& parallel, std::vector<Real>& r) const;
  std::size_t bytes() const { return runs_.size() * sizeof(Run) + row_begin_.size() * sizeof(std::size_t); }

 private:
  // Cells that follow each other along x and belong together.
  struct Run {
    std::size_t first;  // padded cell
    int begin, end;     // along x
    std::size_t part;   // the first run of those that belong together
    bool sealed;        // of the part
    std::size_t last() const { return first + static_cast<std::size_t>(end - begin); }  // the padded cell behind it
  };
  void find_runs(const Parallel& parallel, const PressureLevel& level, const std::vector<std::uint8_t>& moves);
  void join_runs(const Grid& g, const std::vector<std::uint8_t>& moves);
  void find_openings(const Parallel& parallel, const PressureLevel& level, const linalg::Operator& apply);
  std::size_t part_of(std::size_t run);
  // Calls body(run) for all of them, rows in parallel.
  template <class Body>
  void for_runs(const Parallel& parallel, const Body& body) const {
    parallel.for_each(static_cast<std::int64_t>(row_begin_.size()) - 1, [&](std::int64_t row) {
      const auto r = static_cast<std::size_t>(row);
      for (std::size_t run = row_begin_[r]; run < row_begin_[r + 1]; ++run) body(run);
    });
  }
  std::vector<Run> runs_;
  std::vector<std::size_t> row_begin_;  // of the runs of each row of cells, and the end
};

}  // namespace efsi::system
