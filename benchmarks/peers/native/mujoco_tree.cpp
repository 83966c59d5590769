// MuJoCo's recursive Newton-Euler on the cut tree: a free platform, six hinged cranks, and per
// coupler three slides (to the platform joint) and two hinges, along and about the axes of N_i0.
// Of mj_inverse only the four steps that the tree needs are called.
#include <mujoco/mujoco.h>

#include <stdexcept>

#include "entry.hpp"

namespace peer {

class MujocoTree {
 public:
  MujocoTree(const double* constants, const char* model_path) : m_(constants) {
    char error[1000];
    model_ = mj_loadXML(model_path, nullptr, error, sizeof error);
    if (!model_) throw std::runtime_error(error);
    data_ = mj_makeData(model_);
  }
  ~MujocoTree() {
    mj_deleteData(data_);
    mj_deleteModel(model_);
  }

  void torques(const Sample& s, double* tau) {
    const Platform b = place(m_, s);
    const Chains c = move(m_, b);
    fill(b, c);
    mj_kinematics(model_, data_);
    mj_comPos(model_, data_);
    mj_comVel(model_, data_);
    mj_rne(model_, data_, 1, force_);
    project(m_, b, c, forces(b), s, tau);
  }

 private:
  static constexpr int kCoupler = 5;  // coordinates each
  static constexpr int kCranksQ = 7, kCouplersQ = kCranksQ + kChains;
  static constexpr int kCranksV = 6, kCouplersV = kCranksV + kChains;
  static constexpr int kV = kCouplersV + kCoupler * kChains;

  void fill(const Platform& b, const Chains& c) {
    mjtNum *q = data_->qpos, *v = data_->qvel, *a = data_->qacc;
    const Vector3 omega = b.R.transpose() * b.omega, alpha = b.R.transpose() * b.alpha;
    Vector3::Map(q) = b.p;
    Eigen::Vector4d::Map(q + 3) << b.turn.w(), b.turn.x(), b.turn.y(), b.turn.z();
    Vector3::Map(v) = b.v;
    Vector3::Map(v + 3) = omega;
    Vector3::Map(a) = b.a;
    Vector3::Map(a + 3) = alpha;
    const Vectors P = in_frame(m_, c.P), P_d = in_frame(m_, c.P_d), P_dd = in_frame(m_, c.P_dd);
    for (int i = 0; i < kChains; ++i) {
      q[kCranksQ + i] = std::atan2(c.sin[i], c.cos[i]);
      v[kCranksV + i] = c.theta_d[i];
      a[kCranksV + i] = c.theta_dd[i];
      const int k = kCouplersQ + kCoupler * i, j = kCouplersV + kCoupler * i;
      Vector3::Map(q + k) = P.of(i);
      q[k + 3] = c.beta(i);
      q[k + 4] = c.gamma(i);
      Vector3::Map(v + j) = P_d.of(i);
      v[j + 3] = c.beta_d[i];
      v[j + 4] = c.gamma_d[i];
      Vector3::Map(a + j) = P_dd.of(i);
      a[j + 3] = c.beta_dd[i];
      a[j + 4] = c.gamma_dd[i];
    }
  }

  TreeForces forces(const Platform& b) const {
    TreeForces out;
    out.force = Vector3::Map(force_);
    out.moment = b.R * Vector3::Map(force_ + 3);
    Vectors joint;
    for (int lane = 0; lane < kLanes; ++lane) {
      const int i = lane < kChains ? lane : 0;
      const double* f = force_ + kCouplersV + kCoupler * i;
      out.tau_theta[lane] = force_[kCranksV + i];
      joint.x[lane] = f[0];
      joint.y[lane] = f[1];
      joint.z[lane] = f[2];
      out.tau_beta[lane] = f[3];
      out.tau_gamma[lane] = f[4];
    }
    out.joint = from_frame(m_, joint);
    return out;
  }

  Mechanism m_;
  mjModel* model_;
  mjData* data_;
  double force_[kV];
};

}  // namespace peer

PEER_ENTRY(peer::MujocoTree)
