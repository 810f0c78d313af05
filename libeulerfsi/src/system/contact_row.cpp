#include "system/contact_row.hpp"

#include <algorithm>
#include <utility>

namespace efsi::system {

RowAct act(const ContactRow& row, const Vec3d& w) {
  RowAct out;
  out.normal_impulse = std::max(0.0, row.normal_impulse - row.penalty * (row.normal.dot(w) - row.least));
  const double limit = row.friction * out.normal_impulse;
  if (!(limit > 0.0)) return out;
  out.friction_impulse = row.friction_impulse - row.penalty * (w - row.normal.dot(w) * row.normal);
  const double length = out.friction_impulse.norm();
  out.share = length > limit ? limit / length : 1.0;
  out.friction_impulse *= out.share;
  return out;
}

Vec3d row_velocity(const ContactRow& row, const std::vector<Real>& v) {
  Vec3d sum = Vec3d::Zero();
  for (const RowPart& part : row.parts)
    for (std::size_t a = 0; a < 3; ++a)
      sum[static_cast<Eigen::Index>(a)] +=
          static_cast<double>(part.weight) * static_cast<double>(v[3 * part.unknown + a]);
  return sum;
}

std::vector<RowAct> acts(const std::vector<ContactRow>& rows, const std::vector<Real>& v) {
  std::vector<RowAct> all;
  for (const ContactRow& row : rows) all.push_back(act(row, row_velocity(row, v)));
  return all;
}

void close_rows(const Parallel& parallel, const std::vector<ContactRow>& rows, const std::vector<RowAct>& acts,
                VelocitySystem& system, bool held) {
  std::vector<Penalty> penalties;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    if (!acts[r].closed()) continue;
    const ContactRow& row = rows[r];
    const Mat3d along = row.normal * row.normal.transpose(), beside = Mat3d::Identity() - along;
    const double penalty = held ? row.penalty * row.hold : row.penalty;
    penalties.push_back({row.parts, (penalty * (along + acts[r].share * beside)).cast<Real>()});
  }
  system.set_penalties(parallel, std::move(penalties));
}

void add_impulse(const ContactRow& row, const Vec3d& impulse, std::vector<Real>& f) {
  for (const RowPart& part : row.parts)
    for (std::size_t a = 0; a < 3; ++a)
      f[3 * part.unknown + a] += part.weight * static_cast<Real>(impulse[static_cast<Eigen::Index>(a)]);
}

void add_impulses(const std::vector<ContactRow>& rows, std::vector<Real>& f) {
  for (const ContactRow& row : rows) add_impulse(row, row.impulse(), f);
}

}  // namespace efsi::system
