//! Rough interface between two dielectrics (Walter, Marschner, Li, Torrance 2007) with GGX
//! micro-normals.
//!
//! In basic units the transmission kernel is symmetric as it stands: g = |a·m| |b·m| T D G₂ /
//! (|a.z| |b.z| (η_a a·m + η_b b·m)²). With dispersion each lane has its own half vector for one
//! pair of directions, hence its own value and its own density.

use crate::bsdf::microfacet::Ggx;
use crate::bsdf::multiscatter::Exchange;
use crate::bsdf::{BsdfEval, Interface, LaneDensity, cosine_on_side, fresnel};
use crate::spectrum::{MAX_LANES, SampledSpectrum};
use glam::DVec3;

/// GGX dielectric interface.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric {
    /// Micro-normals.
    pub ggx: Ggx,
    /// Factor on reflection per lane.
    pub reflect_tint: SampledSpectrum,
    /// Factor on transmission per lane.
    pub transmit_tint: SampledSpectrum,
    /// Whether light leaves after more than one facet too, where the tables of the interface have
    /// its roughness.
    pub multiple: bool,
}

/// Kernel and densities of one lane for a transmitted pair.
struct Transmission {
    g: f64,
    pdf_camera: f64,
    pdf_light: f64,
}

impl RoughDielectric {
    pub(super) fn eval(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<BsdfEval> {
        let single = if cosine_on_side(w_camera, w_light).is_some() {
            self.eval_reflection(w_light, w_camera, interface)
        } else {
            self.eval_transmission(w_light, w_camera, interface)
        };
        match self.exchange(interface, interface.mean_indices()) {
            Some(multiple) if w_light.z * w_camera.z != 0.0 => {
                let single = single.unwrap_or(BsdfEval::BLACK);
                Some(self.with_multiple(single, &multiple, w_light, w_camera, interface))
            }
            _ => single,
        }
    }

    /// Multiple scattering between media of index `eta` above and below.
    fn exchange<'a>(&self, interface: &Interface<'a>, eta: [f64; 2]) -> Option<Exchange<'a>> {
        if self.multiple {
            Exchange::new(interface.albedos, &self.ggx, eta)
        } else {
            None
        }
    }

    /// Sum of single and multiple scattering: the kernel of each lane, and the densities of `mean`,
    /// which are the same whichever lane is the hero.
    fn with_multiple(
        &self,
        mut eval: BsdfEval,
        mean: &Exchange,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> BsdfEval {
        let (above, below) = (interface.eta_above, interface.eta_below);
        let g = if interface.dispersive {
            interface.lanes(|k| {
                let lane = self.exchange(interface, [above[k], below[k]]);
                lane.map_or(0.0, |lane| lane.kernel(w_light, w_camera))
            })
        } else {
            let hero = mean.kernel(w_light, w_camera);
            interface.lanes(|k| hero * (above[0] / above[k]).powi(2))
        };
        let is_reflected = w_light.z * w_camera.z > 0.0;
        eval.g += g * if is_reflected {
            self.reflect_tint
        } else {
            self.transmit_tint
        };
        let mix = |given: DVec3, generated: DVec3| {
            let p = mean.probability(given);
            let own = p * mean.density(given, generated);
            move |single: f64| (1.0 - p) * single + own
        };
        let (camera, light) = (mix(w_light, w_camera), mix(w_camera, w_light));
        eval.pdf_camera = camera(eval.pdf_camera);
        eval.pdf_light = light(eval.pdf_light);
        if let Some((camera_lanes, light_lanes)) = &mut eval.columns {
            camera_lanes.lanes = camera_lanes.lanes.map(camera);
            light_lanes.lanes = light_lanes.lanes.map(light);
        }
        eval
    }

    fn eval_reflection(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<BsdfEval> {
        let m = (w_light + w_camera).try_normalize()?;
        let cos = w_light.dot(m).clamp(0.0, 1.0);
        let above = w_light.z > 0.0;
        let (near, far) = interface.sides(above);
        let geometry = 0.25 * self.ggx.d(m) * self.ggx.g2_over_cosines(w_light, w_camera);
        let mut eval = BsdfEval::BLACK;
        eval.g = interface
            .lanes(|k| geometry * fresnel::dielectric(cos, near[k], far[k]) / (near[k] * near[k]))
            * self.reflect_tint;
        let jacobian = 0.25 / cos * interface.mean_reflectance(cos, above);
        eval.pdf_camera = self.ggx.visible_pdf(w_light, m) * jacobian;
        eval.pdf_light = self.ggx.visible_pdf(w_camera, m) * jacobian;
        Some(eval)
    }

    fn eval_transmission(
        &self,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<BsdfEval> {
        if w_light.z * w_camera.z >= 0.0 {
            return None;
        }
        let (eta_light, _) = interface.sides(w_light.z > 0.0);
        let mut eval = BsdfEval::BLACK;
        if interface.dispersive && interface.count > 1 {
            let zero = LaneDensity {
                lanes: [0.0; MAX_LANES],
            };
            let (mut camera, mut light) = (zero, zero);
            for k in 0..interface.count {
                // a lane without a half vector for this pair keeps its zeros
                if let Some(lane) = self.lane_transmission(k, w_light, w_camera, interface) {
                    eval.g[k] = (lane.g * f64::from(self.transmit_tint[k])) as f32;
                    camera.lanes[k] = lane.pdf_camera;
                    light.lanes[k] = lane.pdf_light;
                }
            }
            eval.pdf_camera = camera.lanes[0];
            eval.pdf_light = light.lanes[0];
            eval.columns = Some((camera, light));
        } else {
            // one half vector for all lanes; only the overall factor 1/η² of g varies
            let hero = self.lane_transmission(0, w_light, w_camera, interface)?;
            eval.g = interface.lanes(|k| hero.g * (eta_light[0] / eta_light[k]).powi(2))
                * self.transmit_tint;
            eval.pdf_camera = hero.pdf_camera;
            eval.pdf_light = hero.pdf_light;
        }
        Some(eval)
    }

    /// Value (without tint) and densities of lane `k` with its own half vector; `None` where it has
    /// none.
    fn lane_transmission(
        &self,
        k: usize,
        w_light: DVec3,
        w_camera: DVec3,
        interface: &Interface,
    ) -> Option<Transmission> {
        let above = w_light.z > 0.0;
        let (eta_light, eta_camera) = interface.sides(above);
        let (eta_light, eta_camera) = (eta_light[k], eta_camera[k]);
        let m = (eta_light * w_light + eta_camera * w_camera).try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        let (light_m, camera_m) = (w_light.dot(m), w_camera.dot(m));
        // each direction must see the facet from the side it is on
        if light_m * w_light.z <= 0.0 || camera_m * w_camera.z <= 0.0 {
            return None;
        }
        let (cos_light, cos_camera) = (light_m.abs().min(1.0), camera_m.abs().min(1.0));
        let root = eta_light * light_m + eta_camera * camera_m;
        let focus = 1.0 / (root * root);
        let t = 1.0 - fresnel::dielectric(cos_light, eta_light, eta_camera);
        let g = cos_light
            * cos_camera
            * t
            * focus
            * self.ggx.d(m)
            * self.ggx.g2_over_cosines(w_light, w_camera);
        let q_light = 1.0 - interface.mean_reflectance(cos_light, above);
        let q_camera = 1.0 - interface.mean_reflectance(cos_camera, !above);
        let pdf_camera = self.ggx.visible_pdf(w_light, m)
            * q_light
            * (eta_camera * eta_camera * cos_camera * focus);
        let pdf_light = self.ggx.visible_pdf(w_camera, m)
            * q_camera
            * (eta_light * eta_light * cos_light * focus);
        (g.is_finite() && pdf_camera.is_finite() && pdf_light.is_finite()).then_some(Transmission {
            g,
            pdf_camera,
            pdf_light,
        })
    }

    /// A direction for `given` above the surface of `interface`. `None` at total internal
    /// reflection of the hero after transmission was chosen, or when the result is on the wrong
    /// side.
    pub(super) fn generate(
        &self,
        given: DVec3,
        interface: &Interface,
        u: [f64; 3],
        above: bool,
    ) -> Option<DVec3> {
        let mut choice = u[0];
        if let Some(multiple) = self.exchange(interface, interface.mean_indices()) {
            let p = multiple.probability(given_side(given, above));
            if choice < p {
                return Some(multiple.generate(above, [choice / p, u[1], u[2]]));
            }
            choice = (choice - p) / (1.0 - p);
        }
        let m = self.ggx.sample_visible(given, [u[1], u[2]]);
        let cos = given.dot(m).clamp(0.0, 1.0);
        if choice < interface.mean_reflectance(cos, above) {
            let w = 2.0 * cos * m - given;
            (w.z > 0.0).then_some(w)
        } else {
            let (near, far) = interface.sides(above);
            let w = fresnel::refract(given, m, near[0], far[0])?;
            (w.z < 0.0).then_some(w)
        }
    }
}

/// The direction itself of one that was turned up.
fn given_side(up: DVec3, above: bool) -> DVec3 {
    if above {
        up
    } else {
        DVec3::new(up.x, up.y, -up.z)
    }
}
