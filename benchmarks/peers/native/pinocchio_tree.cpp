// Pinocchio's RNEA on the cut tree: a free-flyer platform, six cranks, and per coupler a
// Translation (to the platform joint, where it is cut) and a Universal joint, whose angles turn
// about the base frame N_i0 as the paper's beta_i and gamma_i do.
#include <pinocchio/algorithm/rnea.hpp>

#include "entry.hpp"

namespace peer {

class PinocchioTree {
 public:
  PinocchioTree(const double* constants, const char*) : m_(constants), data_(build(m_)) {}

  void torques(const Sample& s, double* tau) {
    const Platform b = place(m_, s);
    const Chains c = move(m_, b);
    fill(b, c);
    pinocchio::rnea(model_, data_, q_, v_, a_);
    project(m_, b, c, forces(b), s, tau);
  }

 private:
  static constexpr int kCoupler = 5;                       // 3 + 2 velocities each
  static constexpr int kCranksQ = 7, kCouplersQ = kCranksQ + 2 * kChains;
  static constexpr int kCranksV = 6, kCouplersV = kCranksV + kChains;
  static constexpr int kQ = kCouplersQ + kCoupler * kChains;
  static constexpr int kV = kCouplersV + kCoupler * kChains;

  pinocchio::Data build(const Mechanism& m) {
    using pinocchio::Inertia;
    using pinocchio::SE3;
    model_.gravity.linear() = m.gravity;
    const auto platform =
        model_.addJoint(0, pinocchio::JointModelFreeFlyer(), SE3::Identity(), "platform");
    model_.appendBodyToJoint(platform, Inertia(m.mass, Vector3::Zero(), m.inertia));
    for (int i = 0; i < kChains; ++i) {
      SE3 shaft = SE3::Identity();
      shaft.translation() = m.G.of(i);
      shaft.rotation() << m.u.of(i), m.w.of(i), m.u.of(i).cross(m.w.of(i));
      const auto crank = model_.addJoint(0, pinocchio::JointModelRUBZ(), shaft, name("crank", i));
      model_.appendBodyToJoint(
          crank, Inertia(0, Vector3::Zero(), m.crank_inertia[i] * Matrix3::Identity()));
    }
    for (int i = 0; i < kChains; ++i) {
      SE3 home = SE3::Identity();
      home.rotation() << m.N_x.of(i), m.N_y.of(i), m.N_z.of(i);
      const auto end = model_.addJoint(0, pinocchio::JointModelTranslation(), SE3::Identity(),
                                       name("end", i));
      const auto turn = model_.addJoint(
          end, pinocchio::JointModelUniversal(Vector3::UnitY(), Vector3::UnitZ()), home,
          name("coupler", i));
      const Vector3 lever((m.com[i] - 1) * m.coupler[i], 0, 0);
      const Vector3 moments(m.axial[i], m.transverse[i], m.transverse[i]);
      model_.appendBodyToJoint(turn, Inertia(m.mass_i[i], lever, moments.asDiagonal()));
    }
    return pinocchio::Data(model_);
  }

  static std::string name(const char* what, int i) { return what + std::to_string(i); }

  void fill(const Platform& b, const Chains& c) {
    const Matrix3& R = b.R;
    const Vector3 v = R.transpose() * b.v, omega = R.transpose() * b.omega;
    q_.head<3>() = b.p;
    q_.segment<4>(3) = b.turn.coeffs();
    v_.head<3>() = v;
    v_.segment<3>(3) = omega;
    a_.head<3>() = R.transpose() * b.a - omega.cross(v);
    a_.segment<3>(3) = R.transpose() * b.alpha;
    for (int i = 0; i < kChains; ++i) {
      q_[kCranksQ + 2 * i] = c.cos[i];
      q_[kCranksQ + 2 * i + 1] = c.sin[i];
      v_[kCranksV + i] = c.theta_d[i];
      a_[kCranksV + i] = c.theta_dd[i];
      const int k = kCouplersQ + kCoupler * i, j = kCouplersV + kCoupler * i;
      q_.segment<3>(k) = c.P.of(i);
      q_[k + 3] = c.beta(i);
      q_[k + 4] = c.gamma(i);
      v_.segment<3>(j) = c.P_d.of(i);
      v_[j + 3] = c.beta_d[i];
      v_[j + 4] = c.gamma_d[i];
      a_.segment<3>(j) = c.P_dd.of(i);
      a_[j + 3] = c.beta_dd[i];
      a_[j + 4] = c.gamma_dd[i];
    }
  }

  TreeForces forces(const Platform& b) const {
    TreeForces out;
    out.force = b.R * data_.tau.head<3>();
    out.moment = b.R * data_.tau.segment<3>(3);
    for (int lane = 0; lane < kLanes; ++lane) {
      const int i = lane < kChains ? lane : 0, j = kCouplersV + kCoupler * i;
      out.tau_theta[lane] = data_.tau[kCranksV + i];
      out.joint.x[lane] = data_.tau[j];
      out.joint.y[lane] = data_.tau[j + 1];
      out.joint.z[lane] = data_.tau[j + 2];
      out.tau_beta[lane] = data_.tau[j + 3];
      out.tau_gamma[lane] = data_.tau[j + 4];
    }
    return out;
  }

  Mechanism m_;
  pinocchio::Model model_;
  pinocchio::Data data_;
  Eigen::Matrix<double, kQ, 1> q_;
  Eigen::Matrix<double, kV, 1> v_, a_;
};

}  // namespace peer

PEER_ENTRY(peer::PinocchioTree)
