//! The film as a whole: bits, reach, means and errors.

use super::*;
use crate::math::hash::{random_bits, unit_f64};

const CROP: Crop = Crop {
    x0: 2,
    y0: 1,
    x1: 6,
    y1: 4,
};

/// A pixel of it, as the source of splats.
const CORNER: (u32, u32) = (2, 1);

fn random(i: u64) -> f64 {
    unit_f64(random_bits(5, i))
}

#[test]
fn any_order_and_any_threads_give_the_same_bits() {
    let add = |film: &Film, i: u64| {
        let raster = DVec2::new(8.0 * random(3 * i), 5.0 * random(3 * i + 1));
        // ten orders of magnitude: f64 sums would differ
        let value = 10.0_f64.powf(10.0 * random(3 * i + 2) - 5.0);
        film.add_splat(raster, CORNER, (i % 2) as usize, &[value, 0.1 * value]);
    };
    let new = || {
        Film::new(
            CROP,
            Filter::Gaussian {
                sigma: 0.5,
                radius: 1.5,
            },
            2,
        )
    };
    let count = 4000;
    let (forward, backward, threaded) = (new(), new(), new());
    (0..count).for_each(|i| add(&forward, i));
    (0..count).rev().for_each(|i| add(&backward, i));
    std::thread::scope(|scope| {
        for part in 0..4 {
            let (film, add) = (&threaded, &add);
            scope.spawn(move || (part..count).step_by(4).for_each(|i| add(film, i)));
        }
    });
    assert_eq!(forward.sums(), backward.sums());
    assert_eq!(forward.sums(), threaded.sums());
    assert!(forward.sums().iter().all(|&s| s > 0));
    // two parts of disjoint contributions add up to the whole
    let (mut left, right) = (new(), new());
    (0..1500).for_each(|i| add(&left, i));
    (1500..count).for_each(|i| add(&right, i));
    left.add_sums(&right.sums()).unwrap();
    assert_eq!(left.sums(), forward.sums());
    assert_eq!(forward.rejected(), Rejected::default());
}

#[test]
fn box_splats_land_in_one_pixel() {
    let film = Film::new(CROP, Filter::Box, 1);
    for (raster, index) in [
        (DVec2::new(2.0, 1.0), Some(0)),
        (DVec2::new(5.999, 3.999), Some(11)),
        (DVec2::new(3.0, 2.0), Some(5)),
        (DVec2::new(6.0, 2.0), None),
        (DVec2::new(1.999, 2.0), None),
        (DVec2::new(-1e300, 1e300), None),
    ] {
        let before = film.sums();
        film.add_splat(raster, CORNER, 0, &[1.0]);
        let changed: Vec<usize> = (0..before.len())
            .filter(|&i| film.sums()[i] != before[i])
            .collect();
        assert_eq!(changed, index.into_iter().collect::<Vec<_>>(), "{raster}");
    }
}

#[test]
fn a_uniform_field_of_splats_is_flat_to_the_corners() {
    let crop = Crop::whole(4, 3);
    for filter in [
        Filter::Box,
        Filter::Tent { radius: 1.5 },
        Filter::Gaussian {
            sigma: 0.5,
            radius: 2.0,
        },
    ] {
        let film = Film::new(crop, filter, 1);
        // a regular grid over the film widened by the margin, one unit per pixel area
        let (per_pixel, margin) = (40, filter.margin().ceil() as i32);
        let step = 1.0 / f64::from(per_pixel);
        for y in -margin * per_pixel..(3 + margin) * per_pixel {
            for x in -margin * per_pixel..(4 + margin) * per_pixel {
                let raster = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) * step;
                film.add_splat(raster, CORNER, 0, &[step * step]);
            }
        }
        for value in film.image(1) {
            // midpoint rule with 40 points per pixel
            assert!((value - 1.0).abs() < 1e-3, "{filter:?}: {value}");
        }
    }
}

#[test]
fn images_are_means_over_passes() {
    let film = Film::new(CROP, Filter::Box, 2);
    film.add_pixel(3, 2, 0, &[3.0, 30.0]);
    film.add_pixel(3, 2, 1, &[1.0, 10.0]);
    film.add_pixel(0, 0, 0, &[7.0, 7.0]);
    let at = 2 * (4 + 1);
    let image = film.image(4);
    assert_eq!((image[at], image[at + 1]), (1.0, 10.0));
    assert_eq!(image.iter().sum::<f64>(), 11.0);
    let difference = film.half_difference(1, 2, 1).unwrap();
    assert_eq!((difference[at / 2], difference[0]), (5.0, 0.0));
    assert!(film.half_difference(1, 4, 0).is_none());
    assert!(film.image(0).iter().all(|&v| v == 0.0));
}

#[test]
fn standard_error_predicts_the_spread() {
    // 5 even and 4 odd passes of uniform noise on a constant image
    let crop = Crop::whole(60, 60);
    let film = Film::new(crop, Filter::Box, 1);
    let mut i = 0;
    for pass in 0..9 {
        for y in 0..60 {
            for x in 0..60 {
                film.add_pixel(x, y, pass % 2, &[random(1_000_000 + i)]);
                i += 1;
            }
        }
    }
    let errors = film.standard_error(0, 5, 4).unwrap();
    let mean = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    let expected = 1.0 / 12.0 / 9.0;
    // 3600 squares of normal numbers: relative error sqrt(2/3600) = 2.4 %
    assert!((mean / expected - 1.0).abs() < 0.1, "{}", mean / expected);
    assert!(film.standard_error(0, 1, 0).is_none());
    assert!(film.standard_error(1, 5, 4).is_none());
}

#[test]
fn bad_values_are_counted_and_left_out() {
    let film = Film::new(CROP, Filter::Box, 2);
    film.add_pixel(2, 1, 0, &[1.0, f64::NAN]);
    film.add_splat(DVec2::new(2.5, 1.5), CORNER, 0, &[f64::INFINITY, 1.0]);
    film.add_splat(DVec2::new(f64::NAN, 1.5), CORNER, 0, &[1.0, 1.0]);
    film.add_pixel(2, 1, 1, &[1e300, 1.0]);
    assert_eq!(
        film.rejected(),
        Rejected {
            not_finite: 3,
            saturated: 1
        }
    );
    assert!(film.sums().iter().all(|&s| s == 0));
}

#[test]
fn sums_of_other_films_are_refused() {
    let mut film = Film::new(CROP, Filter::Box, 1);
    let expected = film.sums().len();
    let error = film.add_sums(&[1, 2]).unwrap_err();
    assert_eq!(error, AddSumsError::Length { expected, found: 2 });
    film.add_pixel(3, 1, 0, &[1.0]);
    let before = film.sums();
    let error = film.add_sums(&vec![i128::MAX; expected]).unwrap_err();
    assert_eq!(error, AddSumsError::Overflow { index: 1 });
    assert_eq!(film.sums(), before);
}

#[test]
fn sums_that_would_overflow_stay_as_they_are() {
    let mut film = Film::new(CROP, Filter::Box, 1);
    let mut sums = film.sums();
    sums[0] = i128::MAX - 1;
    film.add_sums(&sums).unwrap();
    film.add_pixel(CROP.x0, CROP.y0, 0, &[1.0]);
    assert_eq!(film.sums(), sums);
    assert_eq!(film.rejected().saturated, 1);
    let overflow = AddSumsError::Overflow { index: 0 };
    assert_eq!(film.add_sums(&sums), Err(overflow));
}

#[test]
fn totals_are_known_as_well_as_their_sources() {
    let (resolution, passes) = (Crop::whole(16, 8), [3_u64, 2]);
    let measures: Vec<f64> = (0..128).map(|i| 1.0 + f64::from(i % 3)).collect();
    let film = || {
        Film::new(resolution, Filter::Tent { radius: 1.5 }, 2)
            .with_exponent(20)
            .with_sources(Sources {
                blocks: Blocks::of(&resolution),
                measures: Some(measures.clone().into()),
            })
    };
    // what a splat of 1 adds to the total
    let landed = |film: &Film, raster: DVec2| -> f64 {
        let pixels = (0..128).map(|i| (i % 16, i / 16));
        let center = |(x, y): (u32, u32)| DVec2::new(f64::from(x), f64::from(y)) + 0.5;
        let weights = pixels.map(|pixel| film.filter().eval(raster - center(pixel)));
        weights.zip(&measures).map(|(w, m)| w * m).sum()
    };
    // each sample lands elsewhere; odd passes bring what differs by the source alone
    let (film, blocks) = (film(), Blocks::of(&resolution));
    let mut excesses = vec![0.0; blocks.count() as usize];
    for (x, y) in (0..8).flat_map(|y| (0..16).map(move |x| (x, y))) {
        let excess = random(u64::from(16 * y + x)) - 0.5;
        for pass in 0..5 {
            let at = |i| random(1000 + u64::from(80 * (16 * y + x) + 16 * pass + i));
            // inside, where the filter's weights sum to 1
            let raster = DVec2::new(2.0 + 12.0 * at(0), 2.0 + 4.0 * at(1));
            let value = 1e6 * (1.0 + f64::from(pass & 1) * excess);
            // as much by all measures
            let landed = landed(&film, raster);
            film.add_splat(raster, (x, y), pass as usize & 1, &[value / landed, 0.0]);
        }
        excesses[blocks.at((x, y)).unwrap() as usize] += 1e6 * excess;
    }
    // Var(E - O) = s² (1/3 + 1/2), and the mean of five passes has s²/5
    let squares: f64 = excesses.iter().map(|d| d * d).sum();
    let expected = (squares * 6.0 / 25.0).sqrt();
    let error = film.error_of_total(0..2, passes).expect("both halves");
    assert!((error / expected - 1.0).abs() < 1e-9, "{error}, {expected}");
    assert_eq!(film.error_of_total(1..2, passes), Some(0.0));
    assert_eq!(film.error_of_total(0..2, [3, 0]), None);

    // what lands is what is summed up, and parts add up
    let image = film.image(5);
    let total: f64 = image
        .iter()
        .step_by(2)
        .zip(&measures)
        .map(|(v, m)| v * m)
        .sum();
    let sums = film.sums();
    let rows = (128 * 2, 128 * 2 + 2 * film.blocks() as usize);
    assert_eq!(sums.len(), 2 * rows.1);
    let of_half = |half: usize| sums[half * rows.1..][rows.0..rows.1].iter().step_by(2);
    let by_sources: i128 = of_half(0).chain(of_half(1)).sum();
    let by_sources = fixed::to_f64(by_sources) * f64::exp2(20.0) / 5.0;
    assert!(
        (by_sources / total - 1.0).abs() < 1e-12,
        "{by_sources}, {total}"
    );
    let mut read = Film::new(resolution, Filter::Box, 2)
        .with_exponent(20)
        .with_block_sums(film.blocks());
    read.add_sums(&sums).unwrap();
    assert_eq!(read.sums(), sums);
    assert_eq!(read.error_of_total(0..2, passes), Some(error));
    assert_eq!(read.sums_of_half(1), film.sums_of_half(1));
}
