// MuJoCo's recursive Newton-Euler where it pays most: on six free couplers, one joint each. The
// platform and the cranks are products of a line; attitudes come without arc functions.
#include <mujoco/mujoco.h>

#include <stdexcept>

#include "entry.hpp"

namespace peer {

class MujocoFree {
 public:
  MujocoFree(const double* constants, const char* model_path) : m_(constants) {
    char error[1000];
    model_ = mj_loadXML(model_path, nullptr, error, sizeof error);
    if (!model_) throw std::runtime_error(error);
    data_ = mj_makeData(model_);
    for (int lane = 0; lane < kLanes; ++lane) {
      Matrix3 N;
      const int i = lane < kChains ? lane : 0;
      N << m_.N_x.of(i), m_.N_y.of(i), m_.N_z.of(i);
      const Eigen::Quaterniond q(N);
      home_[0][lane] = q.w();
      home_[1][lane] = q.x();
      home_[2][lane] = q.y();
      home_[3][lane] = q.z();
    }
  }
  ~MujocoFree() {
    mj_deleteData(data_);
    mj_deleteModel(model_);
  }

  void torques(const Sample& s, double* tau) {
    const Platform b = place(m_, s);
    const Chains c = move(m_, b);
    const FreeCouplers f = release(c);
    fill(c, f);
    mj_kinematics(model_, data_);
    mj_comPos(model_, data_);
    mj_comVel(model_, data_);
    mj_rne(model_, data_, 1, force_);
    project(m_, b, c, forces(b, c, f), s, tau);
  }

 private:
  static constexpr int kQ = 7, kV = 6;  // of one coupler

  void fill(const Chains& c, const FreeCouplers& f) {
    const Lanes &w = home_[0], &x = home_[1], &y = home_[2], &z = home_[3];
    const Lanes turn[4] = {w * f.w - x * f.x - y * f.y - z * f.z,
                           w * f.x + x * f.w + y * f.z - z * f.y,
                           w * f.y - x * f.z + y * f.w + z * f.x,
                           w * f.z + x * f.y - y * f.x + z * f.w};
    for (int i = 0; i < kChains; ++i) {
      mjtNum *q = data_->qpos + kQ * i, *v = data_->qvel + kV * i, *a = data_->qacc + kV * i;
      for (int k = 0; k < 4; ++k) q[3 + k] = turn[k][i];
      Vector3::Map(v) = c.P_d.of(i);
      Vector3::Map(v + 3) = f.omega.of(i);
      Vector3::Map(a) = c.P_dd.of(i);
      Vector3::Map(a + 3) = f.alpha.of(i);
    }
  }

  TreeForces forces(const Platform& b, const Chains& c, const FreeCouplers& f) const {
    TreeForces out = without_couplers(m_, b, c);
    Vectors moment;
    for (int lane = 0; lane < kLanes; ++lane) {
      const double* tau = force_ + kV * (lane < kChains ? lane : 0);
      out.joint.x[lane] = tau[0];
      out.joint.y[lane] = tau[1];
      out.joint.z[lane] = tau[2];
      moment.x[lane] = tau[3];
      moment.y[lane] = tau[4];
      moment.z[lane] = tau[5];
    }
    out.tau_beta = f.sin_g * moment.x + f.cos_g * moment.y;
    out.tau_gamma = moment.z;
    return out;
  }

  Mechanism m_;
  Lanes home_[4];  // quaternions of N_i0
  mjModel* model_;
  mjData* data_;
  double force_[kV * kChains];
};

}  // namespace peer

PEER_ENTRY(peer::MujocoFree)
