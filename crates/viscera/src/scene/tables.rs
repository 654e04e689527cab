//! The tables of a scene file as they are written; `Scene::parse` makes a `Scene` of them.

use super::common::{Interpolation, SIZE};
use super::hand_tables::HandTable;
use super::instrument_tables::ToolTable;
use super::region::{RegionKind, RegionLabel};
use crate::material::{LARGEST_POISSON, Preset};
use crate::material::{
    MaterialModel, check_density, check_poisson, check_viscosity, check_young, preset,
};
use crate::scalar::{Vec3, vec3};
use crate::settings::{
    ANY, Kind, Node, Placed, Range, SettingError, SolverSettings, Value, ValueError, above,
    at_least, choices, direction, each, name, number, one_of, optional, placed, quantity,
    settings_table, several, table, tables, text, truth, value_error, vector, whole,
};
use crate::units::Dimension;

settings_table! {
    /// A scene: its bodies, the motions and loads on them, and how they are computed.
    pub(super) struct SceneTable {
        /// A title for tables and pictures.
        title: String = (String::new()), text();
        /// What the scene shows.
        description: String = (String::new()), text();
        /// How long it lasts.
        time: TimeSettings = (TimeSettings::default()), table::<TimeSettings>();
        /// Loads on all bodies.
        world: WorldSettings = (WorldSettings::default()), table::<WorldSettings>();
        /// The bodies; at least one.
        body: Vec<Placed<BodyTable>> = required, tables::<BodyTable>();
        /// Where bodies are held.
        fixing: Vec<Placed<FixingTable>> = (Vec::new()), tables::<FixingTable>();
        /// Patches that are moved along a path.
        motion: Vec<Placed<MotionTable>> = (Vec::new()), tables::<MotionTable>();
        /// Patches that are pulled with a force.
        force: Vec<Placed<ForceTable>> = (Vec::new()), tables::<ForceTable>();
        /// Springs between two vertices.
        spring: Vec<Placed<SpringTable>> = (Vec::new()), tables::<SpringTable>();
        /// Ties between the surfaces of two bodies.
        tie: Vec<Placed<TieTable>> = (Vec::new()), tables::<TieTable>();
        /// How tissue meets tissue.
        contact: ContactSettings = (ContactSettings::default()), table::<ContactSettings>();
        /// Tools that touch tissue, and fixed obstacles.
        tool: Vec<Placed<ToolTable>> = (Vec::new()), tables::<ToolTable>();
        /// Hands that take tools while the scene runs.
        hand: Vec<Placed<HandTable>> = (Vec::new()), tables::<HandTable>();
        /// Settings that change while the scene runs.
        change: Vec<Placed<ChangeTable>> = (Vec::new()), tables::<ChangeTable>();
        /// How a step is solved.
        solver: SolverSettings = (SolverSettings::default()), table::<SolverSettings>();
        /// Files that a run writes.
        output: OutputSettings = (OutputSettings::default()), table::<OutputSettings>();
    }
}

settings_table! {
    #[default]
    /// How long a scene lasts, in steps of one frame.
    pub struct TimeSettings {
        /// Simulated time.
        duration: f64 = 2.0, quantity(Dimension::Time, at_least(1e-6).up_to(86_400.0));
        /// Time step of a frame; `solver.substeps` divides it further. Longer frames lose more
        /// motion to numerical damping. A fraction is legal: "1/60 s".
        frame: f64 = (1.0 / 60.0), quantity(Dimension::Time, at_least(1e-6).up_to(1.0));
        /// Velocities are multiplied with this once per frame: 1 adds no damping, 0.9 makes a body
        /// settle, 0 keeps it quasi-static.
        velocity_factor: f64 = 1.0, number(at_least(0.0).up_to(1.0));
    }
}

settings_table! {
    #[default]
    /// Loads on all bodies. The axes: +z is up; of a patient +x is left and -y is the front.
    pub struct WorldSettings {
        /// Gravity: an acceleration downwards (along -z), or its three components.
        gravity: Vec3<f64> = (vec3(0.0, 0.0, -9.81)), Gravity;
    }
}

settings_table! {
    #[default]
    /// How tissue meets tissue: bodies do not enter each other, nor themselves. Tools have keys of their own. Where bodies are
    /// closer than `thickness` at rest, contact begins at that distance.
    pub struct ContactSettings {
        /// Whether a body meets itself, as in a fold.
        self_: bool = true, truth();
        /// Whether bodies meet each other.
        bodies: bool = true, truth();
        /// Coefficient of friction between tissues; wet tissue is slippery.
        friction: f64 = 0.1, number(at_least(0.0).up_to(5.0));
        /// Stiffness of the contact, in units of each tissue's Young's modulus over the length of its edges.
        stiffness: f64 = 10.0, number(at_least(1e-3).up_to(1e6));
        /// Distance at which contact begins.
        thickness: f64 = 1e-3, quantity(Dimension::Length, at_least(1e-6).up_to(1.0));
    }
}

choices! {
    /// What colours of pictures show.
    pub enum PictureColors {
        /// Films show tissue. So do pictures where nothing moves by more than a thousandth of the scene's size, of several bodies
        /// in their colours; displacement elsewhere.
        Auto = "auto",
        /// As the eye sees it: wet, organs in colours that their names tell, and other bodies red.
        Tissue = "tissue",
        /// How far the surface is from where it began.
        Displacement = "displacement",
        /// Every body has a colour of its own: organs by their names.
        Bodies = "bodies",
    }
}

settings_table! {
    #[default]
    /// Files that a run writes.
    pub struct OutputSettings {
        /// Write every so many frames; the last frame is always written.
        every: u32 = 1, whole(1, 1_000_000);
        /// Write the tetrahedra of each frame as VTU.
        tets: bool = true, truth();
        /// Write the surface of the last frame as OBJ.
        surface: bool = true, truth();
        /// Draw a picture of one frame and an animated image of the motion.
        picture: bool = true, truth();
        /// The moment that the picture shows, to the nearest frame of the animation; the last frame
        /// where unset.
        picture_time: Option<f64> = None, optional(quantity(Dimension::Time, at_least(0.0)));
        /// Width and height of pictures in pixels.
        picture_size: [u32; 2] = ([960, 720]), several::<2, _>(whole(16, 4096));
        /// What colours of pictures show.
        colors: PictureColors = (PictureColors::Auto), one_of::<PictureColors>();
        /// Tell how far forces on tools may be off: the scene runs a second time beside, in half as many substeps, by a thread
        /// of its own where `solver.threads` is not 1. Unset, a run on the CPU does so, and one on a graphics processor, which
        /// takes half as long again for it, does not; in a browser that never does.
        force_error: Option<bool> = None, optional(truth());
        /// Direction from the body towards the camera.
        view_from: Vec3<f64> = (vec3(0.36, -0.8, 0.48)), direction();
    }
}

choices! {
    /// Shapes that need no file.
    pub(super) enum ShapeName {
        /// `length` along x from the plane x = 0, `width` along y, `height` along z, around the x
        /// axis.
        Beam = "beam",
        /// `size` and `cells` along each axis, from the origin.
        Block = "block",
        /// `radius`, centred at the origin.
        Sphere = "sphere",
        /// `radius`, and `length` of its straight part along x, centred at the origin.
        Capsule = "capsule",
        /// A liver of two lobes, about 20 cm wide, centred near the origin.
        Liver = "liver",
    }
}

/// From far below a gel to diamond, and the same for the two below. What lies beyond is a slip of
/// the unit, and the constants of a step would leave single precision: the run would diverge with
/// advice that does not help.
const YOUNG: Range = at_least(1e-3).up_to(1e12);
const DENSITY: Range = at_least(1e-3).up_to(1e5);
const STIFFNESS: Range = at_least(1e-6).up_to(1e12);

settings_table! {
    /// A body: a mesh from a file (`mesh`, `unit`) or a `shape`, its place, and its
    /// material.
    pub(super) struct BodyTable {
        /// The name that fixings, motions and forces refer to.
        name: Placed<String> = required, placed(name());
        /// File with a tetrahedral mesh, relative to the scene file.
        mesh: Option<String> = None, optional(text());
        /// The length that 1 in the mesh file stands for; files rarely say.
        unit: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// File with a fine surface in the unit and frame of `mesh`, bound to the tetrahedra and
        /// shown in their place.
        surface: Option<String> = None, optional(text());
        /// A shape, in place of a file.
        shape: Option<ShapeName> = None, optional(one_of::<ShapeName>());
        /// Length of a beam, or of the straight part of a capsule.
        length: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Width of a beam.
        width: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Height of a beam.
        height: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Cells across the smaller of a beam's width and height; 4 where unset.
        cells_across: Option<u32> = None, optional(whole(1, 200));
        /// Depth of a cut across the middle of a beam, from its upper side down, as a share of the height; rounded
        /// to whole cells. Its sides touch and are not connected.
        cut: Option<f64> = None, optional(number(at_least(0.0).below(1.0)));
        /// Edge lengths of a block.
        size: Option<[f64; 3]> = None, optional(several::<3, _>(quantity(Dimension::Length, SIZE)));
        /// Cells of a block along its edges.
        cells: Option<[u32; 3]> = None, optional(several::<3, _>(whole(1, 10_000)));
        /// Radius of a sphere or capsule.
        radius: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// Distance of the lattice points that a sphere, capsule or liver is filled with. Where
        /// unset, a quarter of the radius, or 18.6 mm times the scale for a liver.
        spacing: Option<f64> = None, optional(quantity(Dimension::Length, SIZE));
        /// How often every tetrahedron is divided into eight: 1 halves the length of edges. Patches are those of the undivided mesh,
        /// with the middles of edges between two of their vertices.
        refine: u32 = 0, whole(0, 3);
        /// Whether the mesh is the body's shape at rest under gravity, as that of a scan is, and not its shape without load:
        /// that one is solved for, so that the body begins at rest. Some of it must be held.
        balanced: bool = false, truth();
        /// Size of a mesh or a liver relative to the file or to the standard liver; 1 where unset.
        scale: Option<f64> = None, optional(number(at_least(1e-3).up_to(1e3)));
        /// Where the body's origin is put.
        position: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Length);
        /// Axis through the body's origin that it is turned about before it is put in place.
        rotation_axis: Vec3<f64> = (vec3(0.0, 0.0, 1.0)), direction();
        /// Angle it is turned by.
        rotation_angle: f64 = 0.0, quantity(Dimension::Angle, ANY);
        /// Its material.
        material: MaterialTable = required, table::<MaterialTable>();
        /// Parts made of something else.
        region: Vec<Placed<RegionTable>> = (Vec::new()), tables::<RegionTable>();
    }
}

settings_table! {
    /// A material: a preset, or its numbers, or a preset with some numbers changed.
    pub(super) struct MaterialTable {
        /// Typical parameters of a tissue.
        preset: Option<&'static Preset> = None, optional(PresetName);
        /// The law between strain and energy; "stable_neo_hookean" where unset.
        model: Option<MaterialModel> = None, optional(one_of::<MaterialModel>());
        /// Young's modulus E at small strain. Needed where there is no preset.
        young: Option<f64> = None, optional(quantity(Dimension::Pressure, YOUNG)
            .checked(|value| check_young(value).map_err(|error| error.to_string())));
        /// Poisson ratio nu; 0.45 where unset. Tissue is nearly incompressible (0.49), and the
        /// nearer to 0.5 the more iterations a step needs.
        poisson: Option<f64> = None, optional(number(above(-1.0).up_to(LARGEST_POISSON))
            .checked(|value| check_poisson(value).map_err(|error| error.to_string())));
        /// Density; "1000 kg/m^3" where unset.
        density: Option<f64> = None, optional(quantity(Dimension::Density, DENSITY)
            .checked(|value| check_density(value).map_err(|error| error.to_string())));
        /// Kelvin-Voigt retardation time: viscous stress is this times stiffness times strain
        /// rate. None where unset.
        viscosity: Option<f64> = None, optional(quantity(Dimension::Time, at_least(0.0))
            .checked(|value| check_viscosity(value).map_err(|error| error.to_string())));
    }
}

settings_table! {
    /// A part of a body that is made of something else: the body's material with these changes.
    pub(super) struct RegionTable {
        /// The label that the part's tetrahedra carry: in the mesh file, or by `sphere`. Also the name of a region of the file.
        label: RegionLabel = required, RegionKind;
        /// Gives the label to the tetrahedra whose middle lies in this ball, in world coordinates at rest: a lump in a
        /// shape. The mesh's own labels where unset.
        sphere: Option<SphereTable> = None, optional(table::<SphereTable>());
        with MaterialTable as material;
    }
}

settings_table! {
    /// An axis-aligned box.
    pub(super) struct BoxTable {
        /// The corner with the smallest coordinates.
        min: Vec3<f64> = required, vector(Dimension::Length);
        /// The corner with the largest coordinates.
        max: Vec3<f64> = required, vector(Dimension::Length);
    }
}

settings_table! {
    /// A ball.
    pub(super) struct SphereTable {
        /// Its centre.
        center: Vec3<f64> = required, vector(Dimension::Length);
        /// Its radius.
        radius: f64 = required, quantity(Dimension::Length, at_least(1e-9).up_to(1e6));
    }
}

settings_table! {
    /// Everything on one side of a plane.
    pub(super) struct HalfSpaceTable {
        /// A point on the plane.
        point: Vec3<f64> = required, vector(Dimension::Length);
        /// Points to the side that is meant.
        normal: Vec3<f64> = required, direction();
    }
}

settings_table! {
    /// The vertices nearest to a point.
    pub(super) struct NearestTable {
        /// The point.
        point: Vec3<f64> = required, vector(Dimension::Length);
        /// How many.
        count: u32 = 1, whole(1, 1_000_000);
    }
}

settings_table! {
    /// Which vertices are meant, in world coordinates at rest: exactly one of the selectors.
    pub(super) struct PatchTable {
        /// The body they belong to.
        body: Placed<String> = required, placed(name());
        /// Vertices in a box.
        r#box: Option<BoxTable> = None, optional(table::<BoxTable>());
        /// Vertices in a ball.
        sphere: Option<SphereTable> = None, optional(table::<SphereTable>());
        /// Vertices on one side of a plane.
        half_space: Option<HalfSpaceTable> = None, optional(table::<HalfSpaceTable>());
        /// The vertices nearest to a point.
        nearest: Option<NearestTable> = None, optional(table::<NearestTable>());
        /// Vertices of the tetrahedra with this label, or of the region of this name in the mesh file.
        region: Option<RegionLabel> = None, optional(RegionKind);
        /// Vertices that the mesh file has this name for: a physical group, a node set. `viscera mesh inspect` lists them.
        patch: Option<String> = None, optional(text());
    }
}

settings_table! {
    /// Where a body is held. Rigidly, or elastically where there is a `stiffness`.
    pub(super) struct FixingTable {
        /// A name for messages and results.
        name: Option<String> = None, optional(name());
        /// Total stiffness of an elastic attachment: every vertex of the patch is tied to its rest
        /// position by a spring of this stiffness divided by their number, so that a finer mesh is
        /// held equally firmly. Rigid where unset.
        stiffness: Option<f64> = None, optional(quantity(Dimension::Stiffness, STIFFNESS));
        with PatchTable as patch;
    }
}

settings_table! {
    /// A pose at a time. Turned first, then moved.
    pub(super) struct MotionKeyTable {
        /// When.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Displacement from where the patch is taken hold of: from rest, without a `start`.
        translation: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Length);
        /// Axis of the rotation, through the motion's `about`.
        rotation_axis: Vec3<f64> = (vec3(0.0, 0.0, 1.0)), direction();
        /// Angle of the rotation; may exceed a full turn. Between keys axis times angle is
        /// interpolated, so keys with one axis turn steadily about it.
        rotation_angle: f64 = 0.0, quantity(Dimension::Angle, ANY);
    }
}

settings_table! {
    /// A patch that is held and moved along a path. Before the first key it goes there from where it is
    /// taken hold of, after the last it stays.
    pub(super) struct MotionTable {
        /// A name for messages and results.
        name: Option<String> = None, optional(name());
        /// Poses in the order of their times.
        keys: Vec<Placed<MotionKeyTable>> = required, tables::<MotionKeyTable>();
        /// Between keys.
        interpolation: Interpolation = (Interpolation::Smooth), one_of::<Interpolation>();
        /// The point that rotations turn about.
        about: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Length);
        /// When the patch is taken hold of, at the beginning of the first frame that does not begin
        /// earlier; where its vertices are then counts as the beginning of the path.
        start: f64 = 0.0, quantity(Dimension::Time, at_least(0.0));
        /// Total stiffness of springs that pull the patch along: every vertex follows its place on the path by
        /// a spring of this stiffness divided by their number. Rigid where unset.
        stiffness: Option<f64> = None, optional(quantity(Dimension::Stiffness, STIFFNESS));
        /// When the patch is let go; never where unset.
        release: Option<f64> = None, optional(quantity(Dimension::Time, at_least(0.0)));
        with PatchTable as patch;
    }
}

settings_table! {
    /// Settings that change while the scene runs; positions and velocities stay.
    pub(super) struct ChangeTable {
        /// When: at the beginning of the first frame that does not begin earlier.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// What, each as `KEY = VALUE` with the keys of overrides: of `solver` (but for its precision), `world`,
        /// and the materials of bodies and their regions.
        set: Vec<String> = required, each(text());
    }
}

settings_table! {
    /// The share of a force at a time.
    pub(super) struct ForceKeyTable {
        /// When.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// The share of the full force.
        factor: f64 = required, number(at_least(-1e9).up_to(1e9));
    }
}

settings_table! {
    /// A patch that is pulled with a force, shared equally among its vertices.
    pub(super) struct ForceTable {
        /// A name for messages and results.
        name: Option<String> = None, optional(name());
        /// The full force on the whole patch.
        force: Vec3<f64> = required, vector(Dimension::Force);
        /// Its share over time: before the first key the first, after the last the last. The full
        /// force throughout where there are none.
        keys: Vec<Placed<ForceKeyTable>> = (Vec::new()), tables::<ForceKeyTable>();
        /// Between keys.
        interpolation: Interpolation = (Interpolation::Linear), one_of::<Interpolation>();
        with PatchTable as patch;
    }
}

settings_table! {
    /// A spring between two vertices: of one patch and of another, those nearest to each other.
    pub(super) struct SpringTable {
        /// A name for messages and results.
        name: Option<String> = None, optional(name());
        /// One end.
        from: Placed<PatchTable> = required, placed(table::<PatchTable>());
        /// The other end.
        to: Placed<PatchTable> = required, placed(table::<PatchTable>());
        /// Force per length beyond `rest_length`.
        stiffness: f64 = required, quantity(Dimension::Stiffness, STIFFNESS);
        /// Length without force; the distance at rest where unset.
        rest_length: Option<f64> = None, optional(quantity(Dimension::Length, at_least(0.0)));
    }
}

settings_table! {
    /// Connective tissue between the surfaces of two bodies: each point of one patch is tied to the nearest point of the
    /// other, as far as it is near enough. It pulls and pushes in every direction from where it is at rest, and tears.
    pub(super) struct TieTable {
        /// A name for messages and results.
        name: Option<String> = None, optional(name());
        /// The patch whose points are tied.
        from: Placed<PatchTable> = required, placed(table::<PatchTable>());
        /// The patch that they are tied to, of another body.
        to: Placed<PatchTable> = required, placed(table::<PatchTable>());
        /// Points that are further from the other patch at rest are not tied.
        distance: f64 = 3e-3, quantity(Dimension::Length, SIZE);
        /// Stiffness per area: the pull per area and distance. Loose connective tissue has about that of 5 kPa over 1 mm.
        stiffness: f64 = 5e6,
            quantity(Dimension::StiffnessPerArea, at_least(1.0).up_to(1e15));
        /// Force per area at which a point tears off; never where unset.
        strength: Option<f64> = None, optional(quantity(Dimension::Pressure, at_least(1e-3).up_to(1e12)));
    }
}

/// Reads gravity: downwards, or by components.
struct Gravity;

impl Kind for Gravity {
    type Value = Vec3<f64>;

    fn read(&self, key: &str, node: &Node) -> Result<Vec3<f64>, SettingError> {
        match &node.value {
            Value::List(_) => vector(Dimension::Acceleration).read(key, node),
            _ => {
                let down = quantity(Dimension::Acceleration, at_least(0.0)).read(key, node)?;
                // Not -0.0 where there is none.
                Ok(vec3(0.0, 0.0, 0.0 - down))
            }
        }
    }

    fn unit(&self) -> &'static str {
        Dimension::Acceleration.si_symbol()
    }

    fn type_text(&self) -> String {
        "an acceleration downwards such as \"9.81 m/s^2\", or a list of three".to_owned()
    }

    fn value_text(&self, value: &Vec3<f64>) -> String {
        vector(Dimension::Acceleration).value_text(value)
    }
}

/// Reads the name of a preset.
struct PresetName;

impl Kind for PresetName {
    type Value = &'static Preset;

    fn read(&self, key: &str, node: &Node) -> Result<&'static Preset, SettingError> {
        let name = text().read(key, node)?;
        preset(&name)
            .map_err(|error| value_error(key, node, ValueError::Choice { hint: error.to_string() }))
    }

    fn type_text(&self) -> String {
        "the name of a preset in quotes".to_owned()
    }

    fn value_text(&self, value: &&'static Preset) -> String {
        format!("\"{}\"", value.name)
    }
}
