//! What tetrahedra are.

use super::choices;

choices! {
    /// How tetrahedra feel that they are deformed.
    pub enum Elements {
        /// Recovered-gradient ones where the method has them, which XPBD does not.
        Auto = "auto",
        /// Each by its corners alone, linear tetrahedra: coarse meshes are too stiff where they bend.
        Plain = "plain",
        /// Each also by how its neighbours are deformed, recovered-gradient tetrahedra: coarse meshes bend as fine ones do.
        Recovered = "recovered",
    }
}
