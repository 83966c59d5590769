// Closed-form closure of the mechanism, shared by the compiled peers: what an engine for trees does
// not do itself. The platform is scalar; the six chains lie in the lanes of one array.
//
// Source: the paper, Section 3, for any two contact planes and any six RSS chains. SI throughout.
#pragma once

#include <Eigen/Dense>
#include <cmath>

namespace peer {

constexpr int kChains = 6;
constexpr int kLanes = 8;  // one AVX-512 register; lanes 6 and 7 repeat chain 0, with weight zero

using Lanes = Eigen::Array<double, kLanes, 1>;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

/// Three-vectors of all chains.
struct Vectors {
  Lanes x, y, z;

  Vector3 of(int chain) const { return {x[chain], y[chain], z[chain]}; }
};

inline Vectors operator+(const Vectors& a, const Vectors& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vectors operator-(const Vectors& a, const Vectors& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vectors operator+(const Vectors& a, const Vector3& b) {
  return {a.x + b.x(), a.y + b.y(), a.z + b.z()};
}
inline Vectors operator*(const Lanes& s, const Vectors& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Lanes dot(const Vectors& a, const Vectors& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Lanes dot(const Vectors& a, const Vector3& b) {
  return a.x * b.x() + a.y * b.y() + a.z * b.z();
}
inline Vectors cross(const Vectors& a, const Vectors& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vectors cross(const Vector3& a, const Vectors& b) {
  return {a.y() * b.z - a.z() * b.y, a.z() * b.x - a.x() * b.z, a.x() * b.y - a.y() * b.x};
}
inline Vectors rotate(const Matrix3& M, const Vectors& a) {
  return {M(0, 0) * a.x + M(0, 1) * a.y + M(0, 2) * a.z,
          M(1, 0) * a.x + M(1, 1) * a.y + M(1, 2) * a.z,
          M(2, 0) * a.x + M(2, 1) * a.y + M(2, 2) * a.z};
}

/// The numbers of a mechanism, in the order in which `Mechanism.packed` writes them.
struct Mechanism {
  Vector3 gravity, load_point;
  double mass;
  Matrix3 inertia;                 // about O_M, in {M}
  Vector3 contact[2], normal[2];   // normal: (-dz/dx, -dz/dy, 1), not of unit length
  double offset[2], gamma_branch;
  Vectors G, u, w, P_M, N_x, N_y, N_z;  // crank directions at theta = 0 and 90 degrees; N_i0
  Lanes crank, coupler, branch, crank_inertia, mass_i, com, transverse, axial, weight;

  explicit Mechanism(const double* data) {
    auto scalar = [&] { return *data++; };
    auto vector = [&] {
      const Vector3 v(data[0], data[1], data[2]);
      data += 3;
      return v;
    };
    auto lanes = [&] {
      Lanes v;
      for (int i = 0; i < kLanes; ++i) v[i] = data[i < kChains ? i : 0];
      data += kChains;
      return v;
    };
    auto vectors = [&] {
      const Lanes x = lanes(), y = lanes(), z = lanes();
      return Vectors{x, y, z};
    };
    gravity = vector();
    load_point = vector();
    mass = scalar();
    for (int row = 0; row < 3; ++row) inertia.row(row) = vector();
    for (int k = 0; k < 2; ++k) {
      contact[k] = vector();
      normal[k] = vector();
      offset[k] = scalar();
    }
    gamma_branch = scalar();
    for (Vectors* v : {&G, &u, &w, &P_M, &N_x, &N_y, &N_z}) *v = vectors();
    for (Lanes* v : {&crank, &coupler, &branch, &crank_inertia, &mass_i, &com, &transverse, &axial})
      *v = lanes();
    weight << 1, 1, 1, 1, 1, 1, 0, 0;
  }
};

/// One sample's input: (X, Y, alpha, beta), rates, accelerations, bite force.
struct Sample {
  double q[4], qd[4], qdd[4], F[3];
};

/// Motion of the platform and how the four independent rates move it.
struct Platform {
  Matrix3 R;
  Eigen::Quaterniond turn;
  Vector3 p, v, a, omega, alpha;
  Vector3 axis[3];                // of alpha', beta', gamma' in {S}: the columns of R_omega
  Eigen::Vector4d Z_q, gamma_q;   // gradients of Z and gamma: the two full rows of M_J
};

inline Platform place(const Mechanism& m, const Sample& s) {
  Platform out;
  // Half angles give the quaternion and, doubled, the matrix.
  double sa, ca, sb, cb;
  ::sincos(0.5 * s.q[2], &sa, &ca);
  ::sincos(0.5 * s.q[3], &sb, &cb);
  const double sin_a = 2 * sa * ca, cos_a = 1 - 2 * sa * sa;
  const double sin_b = 2 * sb * cb, cos_b = 1 - 2 * sb * sb;
  Matrix3 R_xy;
  R_xy << cos_b, 0, sin_b,
      sin_a * sin_b, cos_a, -sin_a * cos_b,
      -cos_a * sin_b, sin_a, cos_a * cos_b;

  // The difference of the two contact equations is A cos(gamma) + B sin(gamma) = C.
  const Vector3 v0 = R_xy.transpose() * m.normal[0], v1 = R_xy.transpose() * m.normal[1];
  const Vector3 &t0 = m.contact[0], &t1 = m.contact[1];
  const Vector3 dn = m.normal[0] - m.normal[1];
  const double A = v0.x() * t0.x() + v0.y() * t0.y() - v1.x() * t1.x() - v1.y() * t1.y();
  const double B = v0.y() * t0.x() - v0.x() * t0.y() - v1.y() * t1.x() + v1.x() * t1.y();
  const double C = m.offset[0] - m.offset[1] - dn.x() * s.q[0] - dn.y() * s.q[1] -
                   v0.z() * t0.z() + v1.z() * t1.z();
  const double h = A * A + B * B, k = m.gamma_branch * std::sqrt(h - C * C), inverse_h = 1 / h;
  const double cos_g = (A * C + B * k) * inverse_h, sin_g = (B * C - A * k) * inverse_h;

  out.R.col(0) = cos_g * R_xy.col(0) + sin_g * R_xy.col(1);
  out.R.col(1) = cos_g * R_xy.col(1) - sin_g * R_xy.col(0);
  out.R.col(2) = R_xy.col(2);
  const double cg = std::sqrt(0.5 + 0.5 * cos_g), sg = 0.5 * sin_g / cg;
  const double cc = ca * cb, ss = sa * sb, sc = sa * cb, cs = ca * sb;
  out.turn = Eigen::Quaterniond(cc * cg - ss * sg, sc * cg + cs * sg, cs * cg - sc * sg,
                                ss * cg + cc * sg);

  const Vector3 r0 = out.R * t0, r1 = out.R * t1;
  const double n_x = m.normal[0].x(), n_y = m.normal[0].y();
  out.p << s.q[0], s.q[1], m.offset[0] - n_x * s.q[0] - n_y * s.q[1] - m.normal[0].dot(r0);

  out.axis[0] = Vector3::UnitX();
  out.axis[1] = Vector3(0, cos_a, sin_a);
  out.axis[2] = R_xy.col(2);
  const Vector3 m0 = r0.cross(m.normal[0]), dm = m0 - r1.cross(m.normal[1]);
  const double inverse = -1 / dm.dot(out.axis[2]), m0_gamma = m0.dot(out.axis[2]);
  out.gamma_q << dn.x(), dn.y(), dm.x(), dm.dot(out.axis[1]);
  out.gamma_q *= inverse;
  out.Z_q << n_x, n_y, m0.x(), m0.dot(out.axis[1]);
  out.Z_q = -out.Z_q - m0_gamma * out.gamma_q;

  const Eigen::Vector4d qd(s.qd[0], s.qd[1], s.qd[2], s.qd[3]);
  const Eigen::Vector4d qdd(s.qdd[0], s.qdd[1], s.qdd[2], s.qdd[3]);
  const double gamma_d = out.gamma_q.dot(qd);
  const Vector3 omega_xy = Vector3(qd[2], 0, 0) + qd[3] * out.axis[1];
  out.v << qd[0], qd[1], out.Z_q.dot(qd);
  out.omega = omega_xy + gamma_d * out.axis[2];

  // Rate of omega but for gamma'', then the contacts' curvature terms give Z'' and gamma''.
  const Vector3 bias = Vector3(0, -qd[2] * qd[3] * sin_a, qd[2] * qd[3] * cos_a) +
                       gamma_d * omega_xy.cross(out.axis[2]);
  auto curvature = [&](const Vector3& n, const Vector3& r) {
    return n.dot(out.omega.cross(out.omega.cross(r)));
  };
  const double c0 = curvature(m.normal[0], r0) + m0.dot(bias);
  const double dc = curvature(m.normal[0], r0) - curvature(m.normal[1], r1) + dm.dot(bias);
  const double gamma_bias = dc * inverse;
  out.a << qdd[0], qdd[1], out.Z_q.dot(qdd) - c0 - m0_gamma * gamma_bias;
  out.alpha = Vector3(qdd[2], 0, 0) + qdd[3] * out.axis[1] +
              (out.gamma_q.dot(qdd) + gamma_bias) * out.axis[2] + bias;
  return out;
}

/// Motion of the six chains.
struct Chains {
  Vectors r, P, P_d, P_dd;     // platform joint: from O_M, position, rates
  Vectors J, t;                // theta' = J . P', t = dS/dtheta
  Lanes cos, sin, theta_d, theta_dd;
  Vectors n, n_d, n_dd;        // coupler direction in N_i0 and its rates
  Lanes cos_gamma, inverse;    // of gamma_i; 1 / cos^2
  Lanes beta_d, beta_dd, gamma_d, gamma_dd;

  double beta(int i) const { return std::atan2(-n.z[i], n.x[i]); }
  double gamma(int i) const { return std::asin(n.y[i]); }
};

/// Components along the axes of N_i0, and back.
inline Vectors in_frame(const Mechanism& m, const Vectors& a) {
  return {dot(m.N_x, a), dot(m.N_y, a), dot(m.N_z, a)};
}

inline Vectors from_frame(const Mechanism& m, const Vectors& a) {
  return a.x * m.N_x + a.y * m.N_y + a.z * m.N_z;
}

inline Chains move(const Mechanism& m, const Platform& b) {
  Chains c;
  c.r = rotate(b.R, m.P_M);
  const Vectors spin = cross(b.omega, c.r);
  c.P = c.r + b.p;
  c.P_d = spin + b.v;
  c.P_dd = cross(b.alpha, c.r) + cross(b.omega, spin) + b.a;

  const Vectors d = c.P - m.G;
  const Lanes a = dot(d, m.u), e_w = dot(d, m.w);
  const Lanes l = m.crank;
  const Lanes reach = (dot(d, d) + l * l - m.coupler * m.coupler) / (2 * l);
  const Lanes h = a * a + e_w * e_w, k = m.branch * (h - reach * reach).sqrt(), inverse_h = 1 / h;
  c.cos = (a * reach + e_w * k) * inverse_h;
  c.sin = (e_w * reach - a * k) * inverse_h;
  const Lanes l_cos = l * c.cos, l_sin = l * c.sin;
  const Vectors arm = l_cos * m.u + l_sin * m.w;
  c.t = l_cos * m.w - l_sin * m.u;
  const Vectors e = d - arm;
  c.J = (1 / (l * k)) * e;
  c.theta_d = dot(c.J, c.P_d);
  const Vectors e_d = c.P_d - c.theta_d * c.t;
  const Lanes turn2 = c.theta_d * c.theta_d;
  const Vectors lifted = c.P_dd + turn2 * arm;
  c.theta_dd = dot(c.J, lifted) + dot(e_d, e_d) / (l * k);
  const Vectors e_dd = lifted - c.theta_dd * c.t;

  const Lanes inverse_L = 1 / m.coupler;
  c.n = inverse_L * in_frame(m, e);
  c.n_d = inverse_L * in_frame(m, e_d);
  c.n_dd = inverse_L * in_frame(m, e_dd);
  const Lanes cos2 = c.n.x * c.n.x + c.n.z * c.n.z;
  c.cos_gamma = cos2.sqrt();
  c.inverse = 1 / cos2;
  const Lanes inverse_cos = c.cos_gamma * c.inverse;
  c.gamma_d = c.n_d.y * inverse_cos;
  c.gamma_dd = (c.n_dd.y + c.n.y * c.gamma_d * c.gamma_d) * inverse_cos;
  c.beta_d = (c.n_d.x * c.n.z - c.n_d.z * c.n.x) * c.inverse;
  c.beta_dd = (c.n_dd.x * c.n.z - c.n_dd.z * c.n.x) * c.inverse +
              2 * c.beta_d * c.gamma_d * c.n.y * inverse_cos;
  return c;
}

/// Couplers as free bodies at their platform joints: {N_i} turned from N_i0, with its motion.
struct FreeCouplers {
  Lanes w, x, y, z;            // quaternion of Ry(beta_i) Rz(gamma_i)
  Lanes cos_b, sin_b, cos_g, sin_g;
  Vectors omega, alpha;        // in {N_i}

  /// From {N_i} to N_i0, and back.
  Vectors to_home(const Vectors& a) const {
    const Lanes x = cos_g * a.x - sin_g * a.y, y = sin_g * a.x + cos_g * a.y;
    return {cos_b * x + sin_b * a.z, y, cos_b * a.z - sin_b * x};
  }
  Vectors to_body(const Vectors& a) const {
    const Lanes x = cos_b * a.x - sin_b * a.z;
    return {cos_g * x + sin_g * a.y, cos_g * a.y - sin_g * x, sin_b * a.x + cos_b * a.z};
  }
};

inline FreeCouplers release(const Chains& c) {
  FreeCouplers f;
  const Lanes inverse_cos = c.cos_gamma * c.inverse;
  f.cos_b = c.n.x * inverse_cos;
  f.sin_b = -c.n.z * inverse_cos;
  f.cos_g = c.cos_gamma;
  f.sin_g = c.n.y;
  // Half angles without arc functions; a coupler never folds back on its home direction.
  const Lanes cb = (0.5 + 0.5 * f.cos_b).sqrt(), sb = 0.5 * f.sin_b / cb;
  const Lanes cg = (0.5 + 0.5 * f.cos_g).sqrt(), sg = 0.5 * f.sin_g / cg;
  f.w = cb * cg;
  f.x = sb * sg;
  f.y = sb * cg;
  f.z = cb * sg;
  f.omega = {f.sin_g * c.beta_d, f.cos_g * c.beta_d, c.gamma_d};
  f.alpha = {f.sin_g * c.beta_dd + f.omega.y * c.gamma_d,
             f.cos_g * c.beta_dd - f.omega.x * c.gamma_d, c.gamma_dd};
  return f;
}

/// Forces that an engine found on the cut tree.
struct TreeForces {
  Vector3 force, moment;  // on the platform, about O_M, in {S}
  Vectors joint;          // on the couplers' ends at the platform joints, in {S}
  Lanes tau_beta, tau_gamma, tau_theta;
};

/// The products that need no engine: the platform's and the cranks' inertia forces.
inline TreeForces without_couplers(const Mechanism& m, const Platform& b, const Chains& c) {
  TreeForces out;
  const Vector3 omega = b.R.transpose() * b.omega, alpha = b.R.transpose() * b.alpha;
  out.force = m.mass * (b.a - m.gravity);
  out.moment = b.R * (m.inertia * alpha + omega.cross(m.inertia * omega));
  out.tau_theta = m.crank_inertia * c.theta_dd;
  return out;
}

/// Solution of a symmetric positive definite system of four, by L D L^T in straight-line code.
inline Eigen::Vector4d solve(Eigen::Matrix4d M, Eigen::Vector4d x) {
  double inverse[4];
#pragma GCC unroll 4
  for (int j = 0; j < 4; ++j) {
    inverse[j] = 1 / M(j, j);
#pragma GCC unroll 4
    for (int i = j + 1; i < 4; ++i) {
      const double factor = M(i, j) * inverse[j];
#pragma GCC unroll 4
      for (int k = i; k < 4; ++k) M(k, i) -= factor * M(k, j);
      x[i] -= factor * x[j];
    }
  }
#pragma GCC unroll 4
  for (int j = 3; j >= 0; --j) {
#pragma GCC unroll 4
    for (int i = j + 1; i < 4; ++i) x[j] -= M(i, j) * x[i];
    x[j] *= inverse[j];
  }
  return x;
}

/// Minimum-norm torques that balance the tree's forces and the bite along the four freedoms.
inline void project(const Mechanism& m, const Platform& b, const Chains& c, const TreeForces& tree,
                    const Sample& s, double* tau) {
  const Lanes beta = tree.tau_beta * c.inverse / m.coupler;
  const Lanes gamma = tree.tau_gamma * c.inverse * c.cos_gamma / m.coupler;
  const Vectors g = (beta * c.n.z) * m.N_x + gamma * m.N_y - (beta * c.n.x) * m.N_z;
  const Lanes along = m.weight * (tree.tau_theta - dot(g, c.t));
  const Vectors F_P = m.weight * (tree.joint + g) + along * c.J;
  const Vectors M_P = cross(c.r, F_P);

  const Vector3 bite(s.F[0], s.F[1], s.F[2]);
  const Vector3 force = tree.force - bite + Vector3(F_P.x.sum(), F_P.y.sum(), F_P.z.sum());
  const Vector3 moment = tree.moment - (b.R * m.load_point).cross(bite) +
                         Vector3(M_P.x.sum(), M_P.y.sum(), M_P.z.sum());
  const double on_gamma = moment.dot(b.axis[2]);
  Eigen::Vector4d Q(force.x(), force.y(), moment.x(), moment.dot(b.axis[1]));
  Q += force.z() * b.Z_q + on_gamma * b.gamma_q;

  // A: crank rates per independent rate, one column an array.
  const Vectors J = m.weight * c.J, rJ = cross(c.r, J);
  const Lanes J_gamma = dot(rJ, b.axis[2]);
  Lanes A[4] = {J.x, J.y, rJ.x, dot(rJ, b.axis[1])};
  for (int j = 0; j < 4; ++j) A[j] += J.z * b.Z_q[j] + J_gamma * b.gamma_q[j];
  Eigen::Matrix4d normal;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j <= i; ++j) normal(i, j) = (A[i] * A[j]).sum();
  const Eigen::Vector4d x = solve(normal, Q);
  const Lanes torque = A[0] * x[0] + A[1] * x[1] + A[2] * x[2] + A[3] * x[3];
  for (int i = 0; i < kChains; ++i) tau[i] = torque[i];
}

}  // namespace peer
