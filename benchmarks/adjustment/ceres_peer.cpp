// The peer of the benchmark: C++ Ceres with automatic derivatives.
//
//   ceres_peer tank problem.bin     a tank network, as written by sim_tank.py
//   ceres_peer bal problem.txt      "Bundle Adjustment in the Large"
//   ceres_peer network problem.txt  a geodetic network, as written by network.py
//
// Then one command a line on standard input, one line of JSON on standard output for each:
//   solve SOLVER RADIUS FTOL        from the start values; RADIUS is initial_trust_region_radius
//   covariance full | marginal | points    of all points, at the last solution; points: with
//                                   their coordinates and standard deviations
//   version                         of Ceres
// SOLVER: SPARSE_NORMAL_CHOLESKY (Ceres' default), SPARSE_SCHUR, DENSE_SCHUR
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

using Vector = std::vector<double>;
constexpr int kInterior = 10;
// Unknowns are multiples of these: raw K1..K3 per mm^2.. make Ceres' covariance call it singular.
const double kUnit[kInterior] = {1, 1, 1, 1e-8, 1e-12, 1e-16, 1e-7, 1e-7, 1e-4, 1e-4};

double Now() {  // seconds of processor
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

// Distortion added to the ideal coordinate; the formulas of sim_tank.py.
struct TankImage {
  double x, y, weight;
  template <typename T>
  bool operator()(const T* const io, const T* const eo, const T* const point, T* out) const {
    T q[kInterior];
    for (int i = 0; i < kInterior; ++i) q[i] = io[i] * kUnit[i];
    const T p[3] = {point[0] - eo[0], point[1] - eo[1], point[2] - eo[2]};
    const T sa = sin(eo[3]), ca = cos(eo[3]), sv = sin(eo[4]), cv = cos(eo[4]);
    const T sk = sin(eo[5]), ck = cos(eo[5]);
    const T ahead = sa * cv * p[0] + ca * cv * p[1] + sv * p[2];
    const T level = ca * p[0] - sa * p[1];
    const T above = -sa * sv * p[0] - ca * sv * p[1] + cv * p[2];
    const T xb = q[0] * (level * ck + above * sk) / ahead;
    const T yb = q[0] * (-level * sk + above * ck) / ahead;
    const T r2 = xb * xb + yb * yb;
    const T radial = 1.0 + r2 * (q[3] + r2 * (q[4] + r2 * q[5]));
    const T px = q[1] + xb * radial + q[6] * (r2 + 2.0 * xb * xb) + 2.0 * q[7] * xb * yb +
                 q[8] * xb + q[9] * yb;
    const T py = q[2] + yb * radial + 2.0 * q[6] * xb * yb + q[7] * (r2 + 2.0 * yb * yb);
    out[0] = (px - x) * weight;
    out[1] = (py - y) * weight;
    return true;
  }
};

struct Distance {
  double value, weight;
  template <typename T>
  bool operator()(const T* const a, const T* const b, T* out) const {
    const T d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    out[0] = (sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - value) * weight;
    return true;
  }
};

struct Control {
  double value[3], weight;
  template <typename T>
  bool operator()(const T* const a, T* out) const {
    for (int i = 0; i < 3; ++i) out[i] = (a[i] - value[i]) * weight;
    return true;
  }
};

struct BalImage {
  double x, y;
  template <typename T>
  bool operator()(const T* const camera, const T* const point, T* out) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, point, p);
    for (int i = 0; i < 3; ++i) p[i] += camera[3 + i];
    const T xp = -p[0] / p[2], yp = -p[1] / p[2], r2 = xp * xp + yp * yp;
    const T f = camera[6] * (1.0 + r2 * (camera[7] + r2 * camera[8]));
    out[0] = f * xp - x;
    out[1] = f * yp - y;
    return true;
  }
};

// A reading of a total station: horizontal direction (0), zenith angle (1), distance (2).
struct Sight {
  int kind;
  double value, weight;
  template <typename T>
  bool operator()(const T* const from, const T* const to, const T* const turn, T* out) const {
    const T d[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    const T p = sqrt(d[0] * d[0] + d[1] * d[1]);
    if (kind == 0) {
      const T off = atan2(d[0], d[1]) - turn[0] - value;
      out[0] = atan2(sin(off), cos(off)) * weight;  // from -pi to pi
    } else {
      out[0] = ((kind == 1 ? atan2(p, d[2]) : sqrt(p * p + d[2] * d[2])) - value) * weight;
    }
    return true;
  }
};

struct Peer {
  Vector start, now;                // all unknowns
  std::vector<double*> points;      // blocks of three
  std::vector<double*> others;      // photos and cameras
  std::vector<double*> in_distances;
  std::unique_ptr<ceres::Problem> problem = std::make_unique<ceres::Problem>();
};

template <typename T>
std::vector<T> Read(std::ifstream& file, size_t count) {
  std::vector<T> values(count);
  file.read(reinterpret_cast<char*>(values.data()), count * sizeof(T));
  return values;
}

void LoadTank(const char* path, Peer* peer) {
  std::ifstream file(path, std::ios::binary);
  const auto n = Read<int>(file, 6);
  const double sigma = Read<double>(file, 1)[0];
  const int photos = n[0], points = n[1], rays = n[2], distances = n[3], controls = n[4];
  peer->start = Read<double>(file, kInterior + 6 * photos + 3 * points);
  for (int i = 0; i < kInterior; ++i) peer->start[i] /= kUnit[i];
  peer->now = peer->start;
  double* base = peer->now.data();
  auto photo = [=](int i) { return base + kInterior + 6 * i; };
  auto point = [=](int i) { return base + kInterior + 6 * photos + 3 * i; };
  const auto ph = Read<int>(file, rays), pt = Read<int>(file, rays);
  const auto xy = Read<double>(file, 2 * rays);
  for (int i = 0; i < rays; ++i)
    peer->problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<TankImage, 2, kInterior, 6, 3>(
            new TankImage{xy[2 * i], xy[2 * i + 1], 1 / sigma}),
        nullptr, base, photo(ph[i]), point(pt[i]));
  const auto from = Read<int>(file, distances), to = Read<int>(file, distances);
  const auto length = Read<double>(file, distances), sd = Read<double>(file, distances);
  for (int i = 0; i < distances; ++i) {
    peer->problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Distance, 1, 3, 3>(new Distance{length[i], 1 / sd[i]}),
        nullptr, point(from[i]), point(to[i]));
    peer->in_distances.push_back(point(from[i]));
    peer->in_distances.push_back(point(to[i]));
  }
  const auto id = Read<int>(file, controls);
  const auto xyz = Read<double>(file, 3 * controls), csd = Read<double>(file, controls);
  for (int i = 0; i < controls; ++i)
    peer->problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Control, 3, 3>(
            new Control{{xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]}, 1 / csd[i]}),
        nullptr, point(id[i]));
  peer->others.push_back(base);
  for (int i = 0; i < photos; ++i) peer->others.push_back(photo(i));
  for (int i = 0; i < points; ++i) peer->points.push_back(point(i));
}

void LoadBal(const char* path, Peer* peer) {
  std::ifstream file(path);
  int cameras, points, rays;
  file >> cameras >> points >> rays;
  std::vector<int> camera(rays), point(rays);
  Vector xy(2 * rays);
  for (int i = 0; i < rays; ++i) file >> camera[i] >> point[i] >> xy[2 * i] >> xy[2 * i + 1];
  peer->start.resize(9 * cameras + 3 * points);
  for (double& value : peer->start) file >> value;
  peer->now = peer->start;
  double* base = peer->now.data();
  for (int i = 0; i < rays; ++i)
    peer->problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<BalImage, 2, 9, 3>(
            new BalImage{xy[2 * i], xy[2 * i + 1]}),
        nullptr, base + 9 * camera[i], base + 9 * cameras + 3 * point[i]);
  for (int i = 0; i < cameras; ++i) peer->others.push_back(base + 9 * i);
  for (int i = 0; i < points; ++i) peer->points.push_back(base + 9 * cameras + 3 * i);
}

void LoadNetwork(const char* path, Peer* peer) {
  std::ifstream file(path);
  int stations, points, sights, controls;  // stations are the first points, a set of directions each
  file >> stations >> points >> sights >> controls;
  peer->start.resize(3 * points + stations);
  for (double& value : peer->start) file >> value;
  peer->now = peer->start;
  double* base = peer->now.data();
  for (int i = 0; i < sights; ++i) {
    int kind, from, to;
    double value, sd;
    file >> kind >> from >> to >> value >> sd;
    peer->problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Sight, 1, 3, 3, 1>(new Sight{kind, value, 1 / sd}),
        nullptr, base + 3 * from, base + 3 * to, base + 3 * points + from);
  }
  for (int i = 0; i < controls; ++i) {
    int point;
    double x, y, z, sd;
    file >> point >> x >> y >> z >> sd;
    peer->problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Control, 3, 3>(new Control{{x, y, z}, 1 / sd}), nullptr,
        base + 3 * point);
  }
  for (int i = 0; i < stations; ++i) {
    peer->in_distances.push_back(base + 3 * i);
    peer->others.push_back(base + 3 * points + i);
  }
  for (int i = 0; i < points; ++i) peer->points.push_back(base + 3 * i);
}

void Solve(Peer* peer, const std::string& solver, double radius, double ftol) {
  ceres::Solver::Options options;
  ceres::StringToLinearSolverType(solver, &options.linear_solver_type);
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  if (radius > 0) options.initial_trust_region_radius = radius;
  if (ftol > 0) options.function_tolerance = ftol;
  if (options.linear_solver_type != ceres::SPARSE_NORMAL_CHOLESKY) {
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (double* block : peer->points) ordering->AddElementToGroup(block, 0);
    for (double* block : peer->in_distances) ordering->AddElementToGroup(block, 1);
    for (double* block : peer->others) ordering->AddElementToGroup(block, 1);
    options.linear_solver_ordering = ordering;
  }
  std::copy(peer->start.begin(), peer->start.end(), peer->now.begin());
  ceres::Solver::Summary summary;
  const double begin = Now();
  ceres::Solve(options, peer->problem.get(), &summary);
  std::printf("{\"seconds\": %.6e, \"cost\": %.12e, \"iterations\": %d, \"converged\": %s}\n",
              Now() - begin, summary.final_cost, static_cast<int>(summary.iterations.size()) - 1,
              summary.termination_type == ceres::CONVERGENCE ? "true" : "false");
}

void PointCovariance(Peer* peer, const std::string& kind) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  options.num_threads = 1;
  const double begin = Now();
  ceres::Covariance covariance(options);
  std::vector<std::pair<const double*, const double*>> pairs;
  for (size_t i = 0; i < peer->points.size(); ++i)
    for (size_t j = i; j < (kind == "full" ? peer->points.size() : i + 1); ++j)
      pairs.emplace_back(peer->points[i], peer->points[j]);
  if (!covariance.Compute(pairs, peer->problem.get())) {
    std::printf("{\"error\": \"covariance not computed\"}\n");
    return;
  }
  double trace = 0, block[9];
  if (kind == "full") {
    const std::vector<const double*> blocks(peer->points.begin(), peer->points.end());
    Vector matrix(9 * blocks.size() * blocks.size());
    covariance.GetCovarianceMatrix(blocks, matrix.data());
  }
  const double seconds = Now() - begin;
  for (const double* point : peer->points) {
    covariance.GetCovarianceBlock(point, point, block);
    trace += block[0] + block[4] + block[8];
  }
  std::printf("{\"seconds\": %.6e, \"trace\": %.12e", seconds, trace);
  if (kind == "points") {
    std::printf(", \"points\": [");
    for (size_t i = 0; i < peer->points.size(); ++i) {
      const double* p = peer->points[i];
      covariance.GetCovarianceBlock(p, p, block);
      std::printf("%s[%.15e, %.15e, %.15e, %.12e, %.12e, %.12e]", i ? ", " : "", p[0], p[1], p[2],
                  std::sqrt(block[0]), std::sqrt(block[4]), std::sqrt(block[8]));
    }
    std::printf("]");
  }
  std::printf("}\n");
}

int main(int argc, char** argv) {
  google::InitGoogleLogging(argv[0]);
  Peer peer;
  const std::string problem = argv[1];
  (problem == "tank" ? LoadTank : problem == "bal" ? LoadBal : LoadNetwork)(argv[2], &peer);
  for (std::string line; std::getline(std::cin, line); std::fflush(stdout)) {
    std::istringstream words(line);
    std::string command, what;
    double radius = 0, ftol = 0;
    words >> command >> what >> radius >> ftol;
    if (command == "solve") Solve(&peer, what, radius, ftol);
    if (command == "covariance") PointCovariance(&peer, what);
    if (command == "version") std::printf("{\"version\": \"%s\"}\n", CERES_VERSION_STRING);
  }
}
