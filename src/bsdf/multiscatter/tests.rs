//! White furnaces: rough lobes that absorb nothing lose nothing.

use crate::bsdf::albedo::{AlbedoTables, Needs};
use crate::bsdf::coated::{Coat, CoatedDiffuse};
use crate::bsdf::conductor::{Conductor, Metal};
use crate::bsdf::microfacet::Ggx;
use crate::bsdf::rough_dielectric::RoughDielectric;
use crate::bsdf::tests::{ONE, bsdf, direction, furnace, interface};
use crate::bsdf::{Bsdf, Interface, Lobe};
use crate::spectrum::SampledSpectrum;

const ANGLES: [f64; 5] = [0.0, 30.0, 60.0, 80.0, 86.0];
const ALPHAS: [[f64; 2]; 8] = [
    [0.01, 0.01],
    [0.03, 0.03],
    [0.1, 0.1],
    [0.3, 0.3],
    [0.6, 0.6],
    [1.0, 1.0],
    [0.1, 0.4],
    [1.0, 0.2],
];
const INDICES: [f64; 5] = [1.05, 1.2, 1.5, 2.0, 2.5];
const SAMPLES: u64 = 4000;

fn tables(needs: &Needs) -> &'static AlbedoTables {
    Box::leak(Box::new(AlbedoTables::new(needs)))
}

fn between(above: f64, below: f64, albedos: &'static AlbedoTables) -> Interface<'static> {
    Interface {
        albedos,
        ..interface(&[above], &[below])
    }
}

/// A metal of the index 0 + 3 i, which reflects all, times `tint`.
fn metal(tint: f32) -> Metal {
    Metal {
        n: SampledSpectrum::ZERO,
        k: SampledSpectrum::splat(3.0),
        tint: SampledSpectrum::splat(tint),
    }
}

/// Scattering by a surface of roughness `alpha`, with multiple scattering or without.
type Surface = fn([f64; 2], bool, Interface<'static>) -> Bsdf<'static>;

fn reflector(alpha: [f64; 2], multiple: bool, interface: Interface<'static>) -> Bsdf<'static> {
    let ggx = Ggx { alpha };
    let lobe = if multiple {
        Conductor::new(ggx, metal(1.0), &interface)
    } else {
        Conductor::single(ggx, metal(1.0))
    };
    bsdf(&[(1.0, Lobe::Conductor(lobe))], interface)
}

fn glass(alpha: [f64; 2], multiple: bool, interface: Interface<'static>) -> Bsdf<'static> {
    let lobe = RoughDielectric {
        ggx: Ggx { alpha },
        reflect_tint: ONE,
        transmit_tint: ONE,
        multiple,
    };
    bsdf(&[(1.0, Lobe::RoughDielectric(lobe))], interface)
}

/// A white base under a layer of the index below, relative to that above.
fn coated(alpha: [f64; 2], multiple: bool, interface: Interface<'static>) -> Bsdf<'static> {
    let (ggx, index) = (Ggx { alpha }, interface.eta_below[0]);
    let layer = Metal {
        n: SampledSpectrum::splat((index * interface.eta_above[0]) as f32),
        k: SampledSpectrum::ZERO,
        tint: SampledSpectrum::splat(4.0),
    };
    let base = CoatedDiffuse {
        reflectance: ONE,
        coat: Coat::new(index, 1.0),
        rough: multiple.then_some(ggx),
    };
    let lobes = [
        (0.25, Lobe::Conductor(Conductor::single(ggx, layer))),
        (1.0, Lobe::Coated(base)),
    ];
    bsdf(&lobes, interface)
}

/// Least and largest share of light that comes back, over angles on the side above; their largest
/// standard error, and the mean square of a sample's weight.
struct Range {
    low: f64,
    high: f64,
    error: f64,
    square: f64,
}

fn range(surface: &Bsdf) -> Range {
    let mut range = Range {
        low: f64::INFINITY,
        high: 0.0,
        error: 0.0,
        square: 0.0,
    };
    for degrees in ANGLES {
        let moments = furnace(surface, direction(degrees, 0.4), SAMPLES)[0];
        range.low = range.low.min(moments.mean);
        range.high = range.high.max(moments.mean);
        range.error = range.error.max(moments.standard_error());
        let variance = moments.standard_error().powi(2) * SAMPLES as f64;
        range.square += variance / ANGLES.len() as f64;
    }
    range
}

/// The table of docs/validation.md.
#[test]
fn what_absorbs_nothing_loses_nothing() {
    let mut needs = Needs::default();
    for alpha in ALPHAS {
        needs.reflectors.add(alpha);
        needs.interfaces.add(alpha);
        needs.layers.add(alpha);
    }
    needs.ratios = INDICES.map(|n| [n, n]).to_vec();
    needs.layer_indices = INDICES.to_vec();
    let tables = tables(&needs);
    let mut cases: Vec<(String, Surface, Interface)> = Vec::new();
    let mut add = |name: String, surface, above, below| {
        cases.push((name, surface, between(above, below, tables)));
    };
    add("metal".to_owned(), reflector, 1.0, 1.0);
    for n in INDICES {
        add(format!("glass {n}, outside"), glass, 1.0, n);
        add(format!("glass {n}, inside"), glass, n, 1.0);
        add(format!("coat {n}"), coated, 1.0, n);
    }
    let mut least_single = 1.0_f64;
    println!("| surface | roughness | one facet | several facets | variance of a sample |");
    for (name, surface, interface) in &cases {
        for alpha in ALPHAS {
            let [before, after] =
                [false, true].map(|multiple| range(&surface(alpha, multiple, *interface)));
            let [x, y] = alpha;
            println!(
                "| {name} | {x}, {y} | {:.3} to {:.3} | {:.3} to {:.3} | {:.3}, {:.3} |",
                before.low, before.high, after.low, after.high, before.square, after.square
            );
            // 1 % is what the tables are good for at most, beside the noise
            assert!(after.error < 4e-3, "{name} {alpha:?}: {}", after.error);
            let slack = 5e-3 + 4.5 * after.error;
            assert!(
                after.low > 1.0 - slack && after.high < 1.0 + slack,
                "{name} {alpha:?}: {} to {}",
                after.low,
                after.high
            );
            least_single = least_single.min(before.low);
        }
    }
    // the test can fail
    assert!(least_single < 0.4, "{least_single}");
}
