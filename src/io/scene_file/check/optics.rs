//! Media and materials.

use super::super::error::Problem;
use super::super::plan::{
    AbsorptionPlan, IorPlan, LobePlan, MaterialPlan, MediumPlan, ScalarPlan, SpectrumPlan,
};
use super::super::schema::{
    Absorption, At, Coated, Conductor, Dielectric, Diffuse, Encoding, Lobe, Material, Medium,
    Mirror, Scalar, Thin,
};
use super::spectrum::Use;
use super::{Allowed, Checker, FINITE, NON_NEGATIVE, POSITIVE, Span, UNIT_INTERVAL};
use crate::io::files::FileProblem;

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
                FileProblem::Bad {
                    path: file.get_ref().clone(),
                    message,
                }
                .into(),
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

    pub(super) fn material(&mut self, material: &At<Material>) -> MaterialPlan {
        let at = material.span();
        let m = material.get_ref();
        let mut plan = MaterialPlan {
            lobes: self.lobes(m, &at),
            ..MaterialPlan::default()
        };
        if let Some(normal) = &m.normal {
            let scale = normal
                .get_ref()
                .scale
                .as_ref()
                .map_or(1.0, |s| self.number("scale", s, FINITE));
            let texture = self.texture(&normal.get_ref().texture, Encoding::Linear);
            plan.normal = texture.map(|t| (t, scale));
        }
        let cutoff = m
            .cutoff
            .as_ref()
            .map(|c| self.number("cutoff", c, UNIT_INTERVAL));
        match (&m.coverage, &m.cutoff) {
            (Some(coverage), _) => {
                plan.coverage = Some((self.scalar("coverage", coverage, UNIT_INTERVAL), cutoff));
            }
            (None, Some(cutoff)) => {
                self.conflict(&cutoff.span(), "cutoff is for materials with coverage only");
            }
            (None, None) => {}
        }
        plan
    }

    fn lobes(&mut self, m: &Material, at: &Span) -> Vec<(ScalarPlan, LobePlan)> {
        let lobe = LobeKeys {
            diffuse: m.diffuse.as_ref(),
            mirror: m.mirror.as_ref(),
            conductor: m.conductor.as_ref(),
            dielectric: m.dielectric.as_ref(),
            thin: m.thin.as_ref(),
            coated: m.coated.as_ref(),
        };
        let Some(mix) = &m.mix else {
            let lobe = self.lobe(at, "material", &lobe);
            return lobe
                .map(|l| (ScalarPlan::Constant(1.0), l))
                .into_iter()
                .collect();
        };
        if lobe.given().iter().any(|g| g.1) {
            self.conflict(
                at,
                "a material is either mix or a single lobe (put every lobe into mix)",
            );
        }
        // the layer of a coat is a lobe of its own
        let count: usize = mix
            .get_ref()
            .iter()
            .map(|l| 1 + usize::from(l.get_ref().coated.is_some()))
            .sum();
        if count > MAX_LOBES {
            self.conflict(
                &mix.span(),
                format!("mix has {count} lobes (allowed: at most {MAX_LOBES})"),
            );
        }
        let mut lobes = Vec::new();
        for entry in mix.get_ref() {
            let l: &Lobe = entry.get_ref();
            let weight = self.scalar("weight", &l.weight, UNIT_INTERVAL);
            let keys = LobeKeys {
                diffuse: l.diffuse.as_ref(),
                mirror: l.mirror.as_ref(),
                conductor: l.conductor.as_ref(),
                dielectric: l.dielectric.as_ref(),
                thin: l.thin.as_ref(),
                coated: l.coated.as_ref(),
            };
            let lobe = self.lobe(&entry.span(), "lobe", &keys);
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
        let largest = |weight: &ScalarPlan| match weight {
            ScalarPlan::Constant(w) => *w,
            ScalarPlan::Image { factor, .. } => *factor,
        };
        let sum: f64 = lobes.iter().map(|l| largest(&l.0)).sum();
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

    fn lobe(&mut self, at: &Span, owner: &str, keys: &LobeKeys) -> Option<LobePlan> {
        self.exactly_one(at, owner, &keys.given())?;
        if let Some(d) = keys.diffuse {
            let reflectance = self.spectrum("reflectance", &d.get_ref().reflectance, Use::Surface);
            return Some(LobePlan::Diffuse { reflectance });
        }
        if let Some(m) = keys.mirror {
            return Some(LobePlan::Mirror {
                reflectance: self.fraction("reflectance", m.get_ref().reflectance.as_ref()),
            });
        }
        if let Some(c) = keys.conductor {
            return self.conductor(c);
        }
        if let Some(d) = keys.dielectric {
            let d = d.get_ref();
            return Some(LobePlan::Dielectric {
                alpha: self.roughness(d.roughness.as_ref()),
                reflect_tint: self.fraction("reflect_tint", d.reflect_tint.as_ref()),
                transmit_tint: self.fraction("transmit_tint", d.transmit_tint.as_ref()),
            });
        }
        if let Some(c) = keys.coated {
            let c: &Coated = c.get_ref();
            return Some(LobePlan::Coated {
                reflectance: self.spectrum("reflectance", &c.reflectance, Use::Surface),
                index: c.ior.as_ref().map_or(1.5, |n| self.number("ior", n, INDEX)),
                alpha: self.roughness(c.roughness.as_ref()),
            });
        }
        keys.thin.and_then(|t| self.thin(t))
    }

    fn conductor(&mut self, conductor: &At<Conductor>) -> Option<LobePlan> {
        let c = conductor.get_ref();
        let alpha = self.roughness(c.roughness.as_ref());
        if let (Some(color), None, None, None, None) = (&c.color, &c.metal, &c.eta, &c.k, &c.tint) {
            return Some(LobePlan::ColoredMetal {
                color: self.spectrum("color", color, Use::Surface),
                alpha,
            });
        }
        let tint: SpectrumPlan = self.fraction("tint", c.tint.as_ref());
        let ior = match (&c.metal, &c.eta, &c.k, &c.color) {
            (Some(metal), None, None, None) => IorPlan::Metal {
                name: metal.get_ref().clone(),
                at: metal.span(),
            },
            (None, Some(eta), Some(k), None) => IorPlan::Constant {
                n: self.number("eta", eta, POSITIVE),
                k: self.number("k", k, NON_NEGATIVE),
            },
            _ => {
                self.conflict(
                    &conductor.span(),
                    "conductor needs either metal, or eta and k, or color (without tint)",
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

    fn roughness(&mut self, roughness: Option<&At<Scalar>>) -> [ScalarPlan; 2] {
        match roughness {
            None => [ScalarPlan::Constant(0.0), ScalarPlan::Constant(0.0)],
            Some(roughness) => self.scalars("roughness", roughness, UNIT_INTERVAL),
        }
    }
}

/// The lobe keys of a material or of an entry of its mixture.
struct LobeKeys<'a> {
    diffuse: Option<&'a At<Diffuse>>,
    mirror: Option<&'a At<Mirror>>,
    conductor: Option<&'a At<Conductor>>,
    dielectric: Option<&'a At<Dielectric>>,
    thin: Option<&'a At<Thin>>,
    coated: Option<&'a At<Coated>>,
}

impl LobeKeys<'_> {
    /// Which are given, by name.
    fn given(&self) -> [(&'static str, bool); 6] {
        [
            ("diffuse", self.diffuse.is_some()),
            ("mirror", self.mirror.is_some()),
            ("conductor", self.conductor.is_some()),
            ("dielectric", self.dielectric.is_some()),
            ("thin", self.thin.is_some()),
            ("coated", self.coated.is_some()),
        ]
    }
}
