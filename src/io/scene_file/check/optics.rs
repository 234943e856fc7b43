//! Media and materials.

use super::super::error::Problem;
use super::super::plan::{AbsorptionPlan, IorPlan, LobePlan, MediumPlan, SpectrumPlan};
use super::super::schema::{
    Absorption, At, Conductor, Dielectric, Diffuse, Material, Medium, Mirror, Roughness, Thin,
};
use super::spectrum::Use;
use super::{Allowed, Checker, FINITE, NON_NEGATIVE, POSITIVE, Span, UNIT_INTERVAL};

const INDEX: Allowed = Allowed {
    text: "1 to 10",
    test: |v| (1.0..=10.0).contains(&v),
};
/// Most lobes of a material.
const MAX_LOBES: usize = 4;

impl Checker<'_> {
    pub(super) fn medium(&mut self, name: &str, medium: &At<Medium>) -> MediumPlan {
        let m = medium.get_ref();
        let ior = self
            .index(m, &medium.span())
            .unwrap_or(IorPlan::Constant { n: 1.0, k: 0.0 });
        let absorption = m.absorption.as_ref().and_then(|a| self.absorption(a));
        MediumPlan {
            name: name.to_owned(),
            ior,
            absorption,
            use_k: m.use_k.unwrap_or(true),
        }
    }

    fn index(&mut self, m: &Medium, at: &Span) -> Option<IorPlan> {
        let choices = [
            ("glass", m.glass.is_some()),
            ("ior", m.ior.is_some()),
            ("cauchy", m.cauchy.is_some()),
            ("sellmeier", m.sellmeier.is_some()),
            ("file", m.file.is_some()),
        ];
        self.exactly_one(at, "medium", &choices)?;
        if m.extrapolate && m.file.is_none() {
            self.conflict(at, "extrapolate is for tables (file) only");
        }
        if let Some(glass) = &m.glass {
            return Some(IorPlan::Glass {
                name: glass.get_ref().clone(),
                at: glass.span(),
            });
        }
        if let Some(n) = &m.ior {
            return Some(IorPlan::Constant {
                n: self.number("ior", n, INDEX),
                k: 0.0,
            });
        }
        if let Some(cauchy) = &m.cauchy {
            let c = cauchy.get_ref();
            if c.is_empty() || c.len() > 6 {
                self.conflict(
                    &cauchy.span(),
                    "cauchy needs 1 to 6 coefficients (of λ in µm to the powers 0, -2, -4, ...)",
                );
            }
            c.iter()
                .for_each(|v| _ = self.number_at("cauchy", *v, &cauchy.span(), FINITE));
            return Some(IorPlan::Cauchy(c.clone()));
        }
        if let Some(sellmeier) = &m.sellmeier {
            let terms = sellmeier.get_ref();
            if terms.is_empty() || terms.len() > 6 {
                self.conflict(
                    &sellmeier.span(),
                    "sellmeier needs 1 to 6 terms [B, C] (C in µm²)",
                );
            }
            terms
                .iter()
                .flatten()
                .for_each(|v| _ = self.number_at("sellmeier", *v, &sellmeier.span(), FINITE));
            return Some(IorPlan::Sellmeier(terms.clone()));
        }
        let file = m.file.as_ref()?;
        let rows = self.csv::<3>(file);
        if let Some(row) = rows
            .iter()
            .find(|r| r[0] <= 0.0 || !(INDEX.test)(r[1]) || r[2] < 0.0)
        {
            let message = format!(
                "row {}, {}, {} (allowed: nm > 0, n from 1 to 10, k >= 0)",
                row[0], row[1], row[2]
            );
            self.error(
                &file.span(),
                Problem::BadFile {
                    path: file.get_ref().clone(),
                    message,
                },
            );
        }
        Some(IorPlan::Table {
            rows,
            extrapolate: m.extrapolate,
            at: file.span(),
        })
    }

    fn absorption(&mut self, absorption: &At<Absorption>) -> Option<AbsorptionPlan> {
        match absorption.get_ref() {
            Absorption {
                color: Some(color),
                distance: Some(distance),
                coefficient: None,
            } => {
                let color = self.spectrum("color", color, Use::Fraction);
                Some(AbsorptionPlan::Color {
                    color,
                    distance_m: self.length("distance", distance, POSITIVE),
                })
            }
            Absorption {
                color: None,
                distance: None,
                coefficient: Some(coefficient),
            } => Some(AbsorptionPlan::Coefficient(self.spectrum(
                "coefficient",
                coefficient,
                Use::Coefficient,
            ))),
            _ => {
                self.conflict(
                    &absorption.span(),
                    "absorption needs either color and distance, or coefficient (1/m)",
                );
                None
            }
        }
    }

    pub(super) fn material(&mut self, material: &At<Material>) -> Vec<(f64, LobePlan)> {
        let at = material.span();
        let Material {
            diffuse,
            mirror,
            conductor,
            dielectric,
            thin,
            mix,
        } = material.get_ref();
        let Some(mix) = mix else {
            let lobe = self.lobe(
                &at,
                "material",
                diffuse.as_ref(),
                mirror.as_ref(),
                conductor.as_ref(),
                dielectric.as_ref(),
                thin.as_ref(),
            );
            return lobe.map(|l| (1.0, l)).into_iter().collect();
        };
        if diffuse.is_some()
            || mirror.is_some()
            || conductor.is_some()
            || dielectric.is_some()
            || thin.is_some()
        {
            self.conflict(
                &at,
                "a material is either mix or a single lobe (put every lobe into mix)",
            );
        }
        if mix.get_ref().len() > MAX_LOBES {
            self.conflict(
                &mix.span(),
                format!(
                    "mix has {} lobes (allowed: at most {MAX_LOBES})",
                    mix.get_ref().len()
                ),
            );
        }
        let mut lobes = Vec::new();
        for entry in mix.get_ref() {
            let l = entry.get_ref();
            let weight = self.number("weight", &l.weight, UNIT_INTERVAL);
            let lobe = self.lobe(
                &entry.span(),
                "lobe",
                l.diffuse.as_ref(),
                l.mirror.as_ref(),
                l.conductor.as_ref(),
                l.dielectric.as_ref(),
                l.thin.as_ref(),
            );
            lobes.extend(lobe.map(|lobe| (weight, lobe)));
        }
        let has = |kind: fn(&LobePlan) -> bool| lobes.iter().any(|(_, lobe)| kind(lobe));
        if has(|l| matches!(l, LobePlan::Thin { .. }))
            && has(|l| matches!(l, LobePlan::Dielectric { .. }))
        {
            self.conflict(
                &mix.span(),
                "thin and dielectric do not mix: one passes light straight, the other bends it",
            );
        }
        let sum: f64 = lobes.iter().map(|l| l.0).sum();
        if sum > 1.0 + 1e-9 {
            let what = "the sum of the weights".to_owned();
            self.error(
                &mix.span(),
                Problem::Range {
                    what,
                    value: ((sum * 1e6).round() / 1e6).to_string(),
                    allowed: "at most 1",
                },
            );
        }
        lobes
    }

    #[expect(clippy::too_many_arguments, reason = "one per kind of lobe")]
    fn lobe(
        &mut self,
        at: &Span,
        owner: &str,
        diffuse: Option<&At<Diffuse>>,
        mirror: Option<&At<Mirror>>,
        conductor: Option<&At<Conductor>>,
        dielectric: Option<&At<Dielectric>>,
        thin: Option<&At<Thin>>,
    ) -> Option<LobePlan> {
        let choices = [
            ("diffuse", diffuse.is_some()),
            ("mirror", mirror.is_some()),
            ("conductor", conductor.is_some()),
            ("dielectric", dielectric.is_some()),
            ("thin", thin.is_some()),
        ];
        self.exactly_one(at, owner, &choices)?;
        if let Some(d) = diffuse {
            let reflectance = self.spectrum("reflectance", &d.get_ref().reflectance, Use::Fraction);
            return Some(LobePlan::Diffuse { reflectance });
        }
        if let Some(m) = mirror {
            return Some(LobePlan::Mirror {
                reflectance: self.fraction("reflectance", m.get_ref().reflectance.as_ref()),
            });
        }
        if let Some(c) = conductor {
            return self.conductor(c);
        }
        if let Some(d) = dielectric {
            let d = d.get_ref();
            return Some(LobePlan::Dielectric {
                alpha: self.roughness(d.roughness.as_ref()),
                reflect_tint: self.fraction("reflect_tint", d.reflect_tint.as_ref()),
                transmit_tint: self.fraction("transmit_tint", d.transmit_tint.as_ref()),
            });
        }
        thin.and_then(|t| self.thin(t))
    }

    fn conductor(&mut self, conductor: &At<Conductor>) -> Option<LobePlan> {
        let c = conductor.get_ref();
        let alpha = self.roughness(c.roughness.as_ref());
        let tint: SpectrumPlan = self.fraction("tint", c.tint.as_ref());
        let ior = match (&c.metal, &c.eta, &c.k) {
            (Some(metal), None, None) => IorPlan::Metal {
                name: metal.get_ref().clone(),
                at: metal.span(),
            },
            (None, Some(eta), Some(k)) => IorPlan::Constant {
                n: self.number("eta", eta, POSITIVE),
                k: self.number("k", k, NON_NEGATIVE),
            },
            _ => {
                self.conflict(
                    &conductor.span(),
                    "conductor needs either metal, or eta and k",
                );
                return None;
            }
        };
        Some(LobePlan::Conductor { ior, alpha, tint })
    }

    fn thin(&mut self, thin: &At<Thin>) -> Option<LobePlan> {
        let t = thin.get_ref();
        self.exactly_one(
            &thin.span(),
            "thin",
            &[("ior", t.ior.is_some()), ("glass", t.glass.is_some())],
        )?;
        let ior = match (&t.ior, &t.glass) {
            (Some(n), _) => IorPlan::Constant {
                n: self.number("ior", n, INDEX),
                k: 0.0,
            },
            (_, Some(glass)) => IorPlan::Glass {
                name: glass.get_ref().clone(),
                at: glass.span(),
            },
            _ => return None,
        };
        Some(LobePlan::Thin {
            ior,
            transmit_tint: self.fraction("transmit_tint", t.transmit_tint.as_ref()),
        })
    }

    fn roughness(&mut self, roughness: Option<&At<Roughness>>) -> [f64; 2] {
        let Some(roughness) = roughness else {
            return [0.0; 2];
        };
        let alpha = match *roughness.get_ref() {
            Roughness::Isotropic(a) => [a; 2],
            Roughness::Anisotropic(a) => a,
        };
        for a in alpha {
            self.number_at("roughness", a, &roughness.span(), UNIT_INTERVAL);
        }
        alpha
    }
}
