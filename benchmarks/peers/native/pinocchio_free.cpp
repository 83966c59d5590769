// Pinocchio's RNEA where it pays most: on six free couplers, one joint each. The platform and the
// cranks are products of a line; the couplers' attitude comes as quaternions without arc functions.
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "entry.hpp"

namespace peer {

class PinocchioFree {
 public:
  PinocchioFree(const double* constants, const char*) : m_(constants), data_(build(m_)) {}

  void torques(const Sample& s, double* tau) {
    const Platform b = place(m_, s);
    const Chains c = move(m_, b);
    const FreeCouplers f = release(c);
    fill(c, f);
#ifdef DERIVATIVES  // of the couplers' forces by their own coordinates: a part of the whole
    pinocchio::computeRNEADerivatives(model_, data_, q_, v_, a_);
#else
    pinocchio::rnea(model_, data_, q_, v_, a_);
#endif
    project(m_, b, c, forces(b, c, f), s, tau);
  }

 private:
  static constexpr int kQ = 7, kV = 6;  // of one coupler

  pinocchio::Data build(const Mechanism& m) {
    using pinocchio::Inertia;
    using pinocchio::SE3;
    model_.gravity.linear() = m.gravity;
    for (int i = 0; i < kChains; ++i) {
      SE3 home = SE3::Identity();
      home.rotation() << m.N_x.of(i), m.N_y.of(i), m.N_z.of(i);
      const auto joint = model_.addJoint(0, pinocchio::JointModelFreeFlyer(), home,
                                         "coupler" + std::to_string(i));
      const Vector3 lever((m.com[i] - 1) * m.coupler[i], 0, 0);
      const Vector3 moments(m.axial[i], m.transverse[i], m.transverse[i]);
      model_.appendBodyToJoint(joint, Inertia(m.mass_i[i], lever, moments.asDiagonal()));
    }
    q_.setZero();  // where the couplers are plays no part
    return pinocchio::Data(model_);
  }

  void fill(const Chains& c, const FreeCouplers& f) {
    const Vectors v = f.to_body(in_frame(m_, c.P_d));
    const Vectors a = f.to_body(in_frame(m_, c.P_dd)) - cross(f.omega, v);
    for (int i = 0; i < kChains; ++i) {
      q_.segment<4>(kQ * i + 3) << f.x[i], f.y[i], f.z[i], f.w[i];
      v_.segment<3>(kV * i) = v.of(i);
      v_.segment<3>(kV * i + 3) = f.omega.of(i);
      a_.segment<3>(kV * i) = a.of(i);
      a_.segment<3>(kV * i + 3) = f.alpha.of(i);
    }
  }

  TreeForces forces(const Platform& b, const Chains& c, const FreeCouplers& f) const {
    TreeForces out = without_couplers(m_, b, c);
    Vectors force, moment;
    for (int lane = 0; lane < kLanes; ++lane) {
      const double* tau = data_.tau.data() + kV * (lane < kChains ? lane : 0);
      force.x[lane] = tau[0];
      force.y[lane] = tau[1];
      force.z[lane] = tau[2];
      moment.x[lane] = tau[3];
      moment.y[lane] = tau[4];
      moment.z[lane] = tau[5];
    }
    out.joint = from_frame(m_, f.to_home(force));
    out.tau_beta = f.sin_g * moment.x + f.cos_g * moment.y;
    out.tau_gamma = moment.z;
    return out;
  }

  Mechanism m_;
  pinocchio::Model model_;
  pinocchio::Data data_;
  Eigen::Matrix<double, kQ * kChains, 1> q_;
  Eigen::Matrix<double, kV * kChains, 1> v_, a_;
};

}  // namespace peer

PEER_ENTRY(peer::PinocchioFree)
