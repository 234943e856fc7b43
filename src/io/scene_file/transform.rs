//! `transform` of objects and models.

use super::document::Node;
use super::keys::{Build, Form, Keys, Spec, Table, Value, keys};
use super::reader::Reader;
use super::value::{Direction, Factors, Point};
use glam::{DAffine3, DMat3, DVec3};

/// Product of the steps of a list, the first innermost.
#[derive(Debug)]
pub struct Steps(pub DAffine3);

impl Value for Steps {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(StepKeys::KIND)))
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let mut all = DAffine3::IDENTITY;
        for step in super::value::items(node, "an array", cx)? {
            let table = Table::of(step, StepKeys::NAMES, cx);
            let keys = table.and_then(|t| StepKeys::from_table(&t, cx)?.build(&t, cx));
            all = keys.unwrap_or(DAffine3::IDENTITY) * all;
        }
        Some(Self(all))
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self(DAffine3::IDENTITY))
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}

keys! {
    /// A step of a `transform`; the steps apply in the order of the list. Exactly one key.
    StepKeys = "step" {
        /// Moves.
        translate: Option<Point>;
        /// Turns about an axis through the origin.
        rotate: Option<Turn>;
        /// Turns about x, then y, then z.
        euler_deg: Option<[f64; 3]>, unit "degrees";
        /// Scales by one factor or by one for each axis, not 0.
        scale: Option<Factors>;
        /// Rows of a 3x4 affine matrix, lengths in the last column.
        matrix: Option<Matrix>;
    }
}

impl Build for StepKeys {
    type Output = DAffine3;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<DAffine3> {
        table.exactly_one(Self::NAMES, "a step", cx)?;
        if let Some(Factors(scale)) = self.scale {
            if scale.to_array().contains(&0.0) {
                let message = "scale is 0 (allowed: any other number)";
                cx.conflict(&table.span("scale"), message);
            }
            return Some(DAffine3::from_scale(scale));
        }
        let translate = self.translate.map(|t| DAffine3::from_translation(t.0));
        let rotate = self
            .rotate
            .map(|Turn { axis, rad }| DAffine3::from_axis_angle(axis, rad));
        let euler = self
            .euler_deg
            .map(|deg| DAffine3::from_mat3(euler(DVec3::from_array(deg))));
        let matrix = self.matrix.map(|m| m.0);
        translate.or(rotate).or(euler).or(matrix)
    }
}

/// A turn by any angle about an axis.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Unit vector.
    pub axis: DVec3,
    /// Angle in radians.
    pub rad: f64,
}

keys! {
    /// A turn about an axis.
    TurnKeys = "turn" {
        /// The axis.
        axis: Direction;
        /// The angle.
        deg: f64, unit "degrees";
    }
}

impl Value for Turn {
    fn form() -> Form {
        Form::Table(TurnKeys::KIND)
    }

    fn read(node: Node<'_>, _: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let table = Table::of(node, TurnKeys::NAMES, cx)?;
        let TurnKeys { axis, deg } = TurnKeys::from_table(&table, cx)?;
        Some(Self {
            axis: axis.0,
            rad: deg.to_radians(),
        })
    }
}

/// An affine map: rows of a 3x4 matrix, its translation in meters.
#[derive(Clone, Copy, Debug)]
pub struct Matrix(pub DAffine3);

impl Value for Matrix {
    fn form() -> Form {
        <[[f64; 4]; 3]>::form()
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let rows = <[[f64; 4]; 3]>::read(node, spec, cx)?;
        let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
        let axes = DMat3::from_cols(column(0), column(1), column(2));
        let translation = column(3) * cx.unit_m;
        Some(Self(DAffine3::from_mat3_translation(axes, translation)))
    }
}

/// The rotation about x, then y, then z, in degrees.
pub fn euler(deg: DVec3) -> DMat3 {
    let [x, y, z] = deg.to_array().map(f64::to_radians);
    DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x)
}
