//! The tables of tools in a scene file as they are written.

use super::common::{Interpolation, SIZE};
use super::instrument::ToolKind;
use crate::contact::ContactLaw;
use crate::scalar::{Vec3, vec3};
use crate::settings::{
    ANY, Placed, above, at_least, direction, name, number, one_of, optional, quantity,
    settings_table, several, tables, text, vector, whole,
};
use crate::units::Dimension;

settings_table! {
    /// A tool, or an obstacle where nothing moves it: tissue does not enter it. The working end is at the origin of
    /// the tool's own frame and the shaft along +z. Forces on it are reported.
    pub(super) struct ToolTable {
        /// A name for messages and results.
        name: Option<String> = None, optional(name());
        /// What it is.
        kind: ToolKind = required, one_of::<ToolKind>();
        /// Radius of a sphere, a capsule, a probe, of the two rods of a hook, of a shaft or a tube. Where unset "2.5 mm"
        /// for instruments of 5 mm, which probe, hook, atraumatic grasper and suction tip are, and "5 mm" for a fan
        /// retractor.
        radius: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Length of a capsule between the middles of its round ends, of the shaft of an instrument; "300 mm" where unset
        /// for an instrument.
        length: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Edge lengths of a box; width, thickness and length of a blade, or of each finger of a fan retractor, where
        /// unset ["4 mm", "3 mm", "60 mm"].
        size: Option<[f64; 3]> = None, optional(several::<3, _>(quantity(Dimension::Length, SIZE)));
        /// Radius of the edges of a box, a blade or jaws, at most half the smallest size. Where unset, half of the
        /// smallest size for a blade and a quarter for the others.
        rounding: Option<f64> = None,
            optional(quantity(Dimension::Length, at_least(0.0).up_to(100.0)));
        /// Length of the tip of a hook; "10 mm" where unset.
        tip_length: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Angle between the tip and the shaft of a hook; "90 deg" where unset.
        tip_angle: Option<f64> = None,
            optional(quantity(Dimension::Angle, above(0.0).below(std::f64::consts::PI)));
        /// Width (along x), thickness and length of each jaw of a grasper; of an atraumatic grasper, where unset,
        /// ["5 mm", "3 mm", "20 mm"].
        jaw_size: Option<[f64; 3]> = None,
            optional(several::<3, _>(quantity(Dimension::Length, SIZE)));
        /// Distance between the jaws of a grasper at angle zero; none where unset.
        jaw_gap: Option<f64> = None,
            optional(quantity(Dimension::Length, at_least(0.0).up_to(100.0)));
        /// File with the closed surface of a mesh, relative to the scene file: triangles wound outwards, its working end
        /// at the origin.
        mesh: Option<String> = None, optional(text());
        /// File with one jaw of a grasper, in place of `jaw_size`: along -z from the hinge at the origin, its inner side
        /// at y = 0 or above. The other jaw is the same, turned by half a turn about z.
        jaw_mesh: Option<String> = None, optional(text());
        /// The length that 1 in these files stands for; files rarely say.
        unit: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Height of the ridges of an atraumatic grasper; "0.5 mm" where unset.
        ridge_height: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// From ridge to ridge; "2 mm" where unset.
        ridge_spacing: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Fingers of a fan retractor; 5 where unset.
        fingers: Option<u32> = None, optional(whole(2, 15));
        /// Angle from the first of them to the last; "60 deg" where unset.
        spread: Option<f64> = None, optional(quantity(Dimension::Angle, above(0.0).up_to(WIDEST)));
        /// Radius of the bore of a suction tip; "1.5 mm" where unset.
        inner_radius: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Where the tool's origin is put.
        position: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Length);
        /// Axis through the tool's origin that it is turned about before it is put in place.
        rotation_axis: Vec3<f64> = (vec3(0.0, 0.0, 1.0)), direction();
        /// Angle it is turned by.
        rotation_angle: f64 = 0.0, quantity(Dimension::Angle, ANY);
        /// In place of the two, axis times angle.
        rotation_vector: Option<Vec3<f64>> = None, optional(vector(Dimension::Angle));
        /// When the tool comes into the scene: at the beginning of the first frame that does not begin earlier.
        begin: f64 = 0.0, quantity(Dimension::Time, at_least(0.0));
        /// When it leaves the scene, in the same way; what it held is free. It stays where unset.
        end: Option<f64> = None, optional(quantity(Dimension::Time, at_least(0.0)));
        /// Poses in the order of their times. Before the first the tool goes there from its own pose, after the last
        /// it stays; it stands still where there are none.
        keys: Vec<Placed<ToolKeyTable>> = (Vec::new()), tables::<ToolKeyTable>();
        /// In place of keys, a CSV file with the columns time [s], x, y, z [m] and rx, ry, rz [rad], a rotation vector,
        /// relative to the tool's own pose as keys are. Between its rows, of which the first may be a header, motion
        /// is steady.
        path: Option<String> = None, optional(text());
        /// Between keys of all kinds.
        interpolation: Interpolation = (Interpolation::Smooth), one_of::<Interpolation>();
        /// Opening angles of a grasper's jaws in the order of their times: before the first key the first, after the
        /// last the last.
        jaw: Vec<Placed<JawKeyTable>> = (Vec::new()), tables::<JawKeyTable>();
        /// In place of `jaw`, closing forces in the order of their times: the jaws close, at a limited speed, until
        /// tissue holds against the force.
        closing_force: Vec<Placed<ClosingKeyTable>> = (Vec::new()), tables::<ClosingKeyTable>();
        /// With `closing_force`, the opening angle at the beginning, which is also the widest; "60 deg" where unset.
        jaw_open: Option<f64> = None,
            optional(quantity(Dimension::Angle, above(0.0).up_to(WIDEST)));
        /// With `closing_force`, the time in which jaws that nothing holds close from there; "0.5 s" where unset.
        closing_time: Option<f64> = None,
            optional(quantity(Dimension::Time, at_least(1e-3).up_to(1e3)));
        /// Times at which what the jaws press on is tied to them, as by a ratchet and teeth.
        lock: Vec<Placed<LockTable>> = (Vec::new()), tables::<LockTable>();
        /// Stiffness of the spring between the tool and the hand that its keys stand for: it gives way to tissue, as a tool
        /// that is felt by a haptic device must. Where unset the tool goes where its keys say.
        spring: Option<f64> = None,
            optional(quantity(Dimension::Stiffness, at_least(1e-3).up_to(1e7)));
        /// With `spring`, the mass that moves with the tool; "30 g" where unset.
        mass: Option<f64> = None, optional(quantity(Dimension::Mass, at_least(1e-4).up_to(1e3)));
        /// Coefficient of friction against tissue; 0.1 is slippery, 0.8 ridged jaws.
        friction: f64 = (ContactLaw::default().friction),
            number(at_least(0.0)).checked(check_friction);
        /// Stiffness of the contact, in units of the tissue's Young's modulus over the length of its edges.
        stiffness: f64 = (ContactLaw::default().stiffness), number(at_least(1e-3).up_to(1e6));
        /// Distance at which contact begins: surfaces rest up to this far apart.
        thickness: f64 = (ContactLaw::default().thickness),
            quantity(Dimension::Length, at_least(1e-6).up_to(1.0));
    }
}

/// The widest angle of jaws [rad].
pub(super) const WIDEST: f64 = 2.8;

fn check_friction(friction: f64) -> Result<(), String> {
    let complaint = ContactLaw { friction, ..ContactLaw::default() }.complaint();
    complaint.map_or(Ok(()), |words| Err(words.to_owned()))
}

settings_table! {
    /// A pose of a tool at a time, relative to its own. Turned first, then moved, in axes of the world.
    pub(super) struct ToolKeyTable {
        /// When.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Displacement from its own position.
        translation: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Length);
        /// Axis of the rotation, through the tool's origin.
        rotation_axis: Vec3<f64> = (vec3(0.0, 0.0, 1.0)), direction();
        /// Angle of the rotation; may exceed a full turn. Between keys axis times angle is interpolated.
        rotation_angle: f64 = 0.0, quantity(Dimension::Angle, ANY);
    }
}

settings_table! {
    /// The opening angle of a grasper's jaws at a time.
    pub(super) struct JawKeyTable {
        /// When.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Between the jaws' inner sides. At zero they are parallel and `jaw_gap` apart; below they would overlap
        /// where there is none.
        angle: f64 = required, quantity(Dimension::Angle, ANY);
    }
}

settings_table! {
    /// The closing force of a grasper's jaws at a time.
    pub(super) struct ClosingKeyTable {
        /// When.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Of each jaw, at the middle of its length; below zero they open.
        force: f64 = required, quantity(Dimension::Force, at_least(-1e6).up_to(1e6));
    }
}

settings_table! {
    /// A time at which jaws are locked.
    pub(super) struct LockTable {
        /// Its begin.
        from: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Its end.
        to: f64 = required, quantity(Dimension::Time, at_least(0.0));
    }
}
