//! Reasons in English, for images, reports and the command line: why a render is regularized, and
//! how its first cone and radius were found.

use crate::render::epsilon::{BLUR_PIXELS, EpsilonReason, Prior, Refinement};
use crate::render::merging::{PIXELS, RadiusReason, SHARE};
use crate::scene::regularization::{Decision, Mode, Reason};
use std::fmt::{Display, Formatter, Result};

impl Display for Decision {
    fn fmt(&self, f: &mut Formatter) -> Result {
        match &self.reason {
            Reason::NoConnections => f.write_str("the integrator makes no connections"),
            Reason::SwitchedOff => f.write_str("switched off"),
            Reason::Sequences => f.write_str("paths are held to sequences of surfaces"),
            Reason::NothingSpecular => f.write_str("no surface is a mirror or smooth glass"),
            Reason::AskedFor => f.write_str(match self.mode {
                Some(Mode::Single(_)) => "asked for, only where nothing else makes a path",
                _ => "asked for",
            }),
            Reason::HittableDetector { detector } => write!(
                f,
                "detector \"{detector}\" can be hit by every class of light paths, without bias"
            ),
            Reason::Merging => {
                f.write_str("photon merging makes these paths, too; ask for mis to have both")
            }
            Reason::OneSubpath => f.write_str(
                "only integrators that connect two sub-paths switch it on by themselves",
            ),
            Reason::Chains => f.write_str("chains that are solved for make all of these paths"),
            Reason::Specular { object, camera } => write!(
                f,
                "object \"{object}\" is a mirror or smooth glass, and no light path can hit camera \"{camera}\""
            ),
        }
    }
}

impl Display for EpsilonReason {
    fn fmt(&self, f: &mut Formatter) -> Result {
        match self {
            Self::Given => f.write_str("given"),
            Self::NoSpecularNeighbor => {
                f.write_str("no path of the pilot joins a specular surface to another one")
            }
            Self::Found {
                prior,
                prior_rad,
                refinement,
            } => {
                match prior {
                    Prior::Lights => f.write_str("half the angular radius of the lights")?,
                    Prior::Blur => write!(f, "a blur of {BLUR_PIXELS} pixels")?,
                }
                match refinement {
                    Refinement::Nothing => f.write_str("; nothing regularized in the pilot"),
                    Refinement::Balance(best) => {
                        write!(f, " gives {prior_rad:.4}, bias against variance {best:.4}")
                    }
                    Refinement::LostInNoise => {
                        write!(f, " gives {prior_rad:.4}, its bias is lost in noise")
                    }
                }
            }
        }
    }
}

impl Display for RadiusReason {
    fn fmt(&self, f: &mut Formatter) -> Result {
        match self {
            Self::Given => f.write_str("given"),
            Self::Pixels => write!(f, "{PIXELS} pixels at the distance of what the camera sees"),
            Self::Scene => write!(f, "{SHARE} of the radius of the scene"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_say_what_was_found() {
        let found = |refinement| EpsilonReason::Found {
            prior: Prior::Blur,
            prior_rad: 0.0123,
            refinement,
        };
        let cases = [
            (
                found(Refinement::Balance(0.02)).to_string(),
                "a blur of 8 pixels gives 0.0123, bias against variance 0.0200",
            ),
            (
                found(Refinement::LostInNoise).to_string(),
                "a blur of 8 pixels gives 0.0123, its bias is lost in noise",
            ),
            (
                found(Refinement::Nothing).to_string(),
                "a blur of 8 pixels; nothing regularized in the pilot",
            ),
            (
                RadiusReason::Pixels.to_string(),
                "2 pixels at the distance of what the camera sees",
            ),
            (
                RadiusReason::Scene.to_string(),
                "0.003 of the radius of the scene",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(text, expected);
        }
    }
}
